"""Commander without a controller: outputs by tick, and completeness of its state."""

import copy
import math
import pickle

import pytest
from commander_session import CONSTANTS, DT, HIGH, Session
from flights import command, item

from lapwing.messages import CommandAck
from lapwing.services.autopilot.commander.commander import Commander
from lapwing.services.autopilot.commander.modes.land import descent_speed
from lapwing.services.autopilot.commander.route import Route
from lapwing.services.common.ports import StateEstimate

WAITING = CONSTANTS._replace(has_trajectory=False)
GROUND = StateEstimate(position_world=(1.0, 2.0, 0.35))
GPS_LOST = 1 << 1


def in_the_air(*commands):
    """Return a session after take-off to 3 m and these commands."""
    session = Session(WAITING)
    session.step(estimate=GROUND, commands=(command("arm"), command("takeoff", 3.0)))
    session.run(6.0)
    session.step(commands=commands)
    return session


def route():
    return [item("takeoff", z=3.0), item("waypoint", 9.0, 2.0, 4.0), item("jump", values=(1.0, 1.0)), item("return")]


@pytest.mark.parametrize(
    "mode_command",
    [
        command("goto", 9.0, 0.0, 3.0),
        command("land"),
        command("return"),
        command("descend"),
        command("position_control"),
        command("altitude_control"),
    ],
    ids=lambda c: c.kind,
)
def test_copied_and_pickled_state_behave_alike(mode_command):
    session = in_the_air(mode_command, command("manual", 0.3, 0.2, 0.1, 0.4))
    session.run(0.5)
    copied, pickled = copy.deepcopy(session.commander.state), pickle.loads(pickle.dumps(session.commander.state))
    others = [Commander(WAITING, copied), Commander(WAITING, pickled)]
    views = []
    step = session.commander.step
    session.commander.step = lambda view: views.append(view) or step(view)
    requests = [session.step() for _ in range(800)]
    for other in others:
        assert [repr(other.step(view)) for view in views] == [repr(r) for r in requests]


def test_mission_continues_from_pickled_state():
    session = Session(WAITING)
    session.step(
        estimate=GROUND, commands=(command("mission_upload", items=route()), command("mission"), command("arm"))
    )
    session.run(8.0)
    other = Session(WAITING)
    other.commander.state = pickle.loads(pickle.dumps(session.commander.state))
    for _ in range(3000):
        assert repr(session.step()) == repr(other.step())
    assert session.step().status.mission_current == 3


def test_parameter_values_belong_to_their_tick():
    session = Session(WAITING)
    first = session.step(commands=(command("parameter", 3.0, text="MPC_XY_CRUISE"),))
    session.step(commands=(command("parameter", 4.0, text="MPC_XY_CRUISE"),))
    assert first.parameters["MPC_XY_CRUISE"] == 3.0
    assert session.step().parameters is None
    assert [(a.result, a.value) for a in session.acknowledgements] == [
        (CommandAck.ACCEPTED, 3.0),
        (CommandAck.ACCEPTED, 4.0),
    ]


def test_arming_waits_for_checks():
    session = Session(WAITING)
    unsure = GROUND._replace(health=64)
    session.step(estimate=unsure, commands=(command("arm", float("nan"), 1.0),))
    session.run(0.5, estimate=unsure)
    assert not session.step(estimate=unsure).status.armed
    assert session.step(estimate=GROUND).status.armed
    assert [a.result for a in session.acknowledgements] == [CommandAck.IN_PROGRESS, CommandAck.ACCEPTED]


def test_estimate_setpoint_requests_estimate_every_tick():
    session = in_the_air(command("descend"))
    request = session.step(estimate=HIGH._replace(position_world=(7.0, 8.0, 5.0)))
    assert request.estimate_every_tick
    assert request.setpoint.position_world[:2] == (7.0, 8.0)
    session.step(commands=(command("hold"),))
    assert not session.step().estimate_every_tick


@pytest.mark.parametrize(
    ("height", "known", "speed"),
    [(12.0, False, 1.5), (10.0, False, 1.5), (7.5, False, 1.1), (5.0, False, 0.7), (0.5, False, 0.7), (1.1, True, 0.7),
     (0.9, True, 0.3), (-2.0, True, 0.3)],
)  # fmt: skip
def test_descent_has_the_three_steps_of_px4_above_home(height, known, speed):
    constants, guidance = CONSTANTS._replace(height_known=known), in_the_air().commander.state.guidance
    guidance.home = (0.0, 0.0, 100.0)
    altitude = 100.0 + constants.resting_height + height
    assert descent_speed(constants, guidance, altitude) == pytest.approx(speed)


def test_after_landing_controller_is_reset_and_vehicle_disarms():
    session = in_the_air(command("land"))
    assert not session.step().reset_controller
    landed = session.step(motors_cut=True)
    assert landed.reset_controller
    assert landed.status.armed
    assert not session.run(2.0 + 2 * DT).status.armed
    assert session.texts == ["armed", "landed", "disarmed: landed"]


def test_failsafe_is_announced_and_acts_after_its_delay():
    session = in_the_air()
    lost = HIGH._replace(health=GPS_LOST)
    session.run(9.0, estimate=lost)
    assert session.texts[1:] == ["the position is lost: descend in 9 s"]
    assert session.run(1.1, estimate=lost).status.failsafe == "the position is lost"
    assert session.texts[2:] == ["the position is lost: descend"]


def test_operator_takes_over_from_trajectory():
    session = Session(CONSTANTS._replace(has_trajectory=True))
    assert session.step().setpoint is None
    request = session.step(commands=(command("hold"),))
    assert request.setpoint.position_world == pytest.approx((1.0, 2.0, 5.0))
    assert request.status.mode == "hold"
    assert session.step().status.armed


def test_unreachable_takeoff_item_is_skipped():
    session = in_the_air(command("goto", 1.0, 2.0, 9.0))
    session.run(8.0)
    items = [item("takeoff"), item("waypoint", 9.0, 2.0, 4.0)]
    session.step(commands=(command("mission_upload", items=items), command("mission")))
    assert session.run(0.1).status.mission_current == 1  # already above the item's altitude
    session.step(commands=(command("mission_upload", items=[item("takeoff", z=2000.0)]),))
    assert session.acknowledgements[-1].result == CommandAck.DENIED
    assert session.texts[-1] == "item 1: take-off to 2000 m; expected at most 1000 m"


SPEED = item("speed", values=(2.0,))
WAYPOINT = item("waypoint", 9.0, 2.0, 4.0)
CIRCLES = {
    "jump to itself": [WAYPOINT, item("jump", values=(1.0, 1e9))],
    "two jumps": [WAYPOINT, item("jump", values=(2.0, 1e9)), item("jump", values=(1.0, 1e9))],
    "jump over a speed": [WAYPOINT, SPEED, item("jump", values=(1.0, 1e9))],
    "zero delay": [WAYPOINT, item("delay"), item("jump", values=(1.0, 1e9))],
}


@pytest.mark.parametrize("items", CIRCLES.values(), ids=CIRCLES)
def test_jumps_in_circle_are_denied(items):
    session = in_the_air(command("mission_upload", items=items))
    assert session.acknowledgements[-1].result == CommandAck.DENIED
    assert session.texts[-1].endswith("jumps in a circle without a waypoint; jump to a waypoint")
    assert not session.commander.state.guidance.route.items


@pytest.mark.parametrize("repetitions", [1.0, 1e9])
def test_circle_with_waypoint_is_flown(repetitions):
    items = [
        WAYPOINT,
        item("delay", hold=1.0),
        item("jump", values=(1.0, repetitions)),
        item("jump", values=(0.0, 1e9)),
    ]
    session = in_the_air(command("mission_upload", items=items), command("mission"))
    assert session.acknowledgements[-1].result == CommandAck.ACCEPTED
    session.run(6.0)
    assert session.step().status.mode == "mission"


def test_search_of_following_items_is_bounded():
    jumps = [item("jump", values=(float(k + 1), 1e9)) for k in range(1, 400)]
    following = [*Route([WAYPOINT, *jumps, item("yaw", yaw=0.0), item("jump", values=(1.0, 1e9))]).following(32)]
    assert [i.action for i in following] == ["yaw"] * 32
    assert [*Route([WAYPOINT]).following(32)] == []


def test_first_position_must_be_near():
    far = [item("takeoff", z=3.0), item("waypoint", 602.0, 802.0, 3.0)]
    session = in_the_air(command("parameter", 1000.0, text="MIS_DIST_1WP"), command("mission_upload", items=far))
    assert session.acknowledgements[-1].result == CommandAck.DENIED
    assert session.texts[-1] == "item 2: 1001 m from the start; expected at most 1000 m (MIS_DIST_1WP)"
    session.step(commands=(command("parameter", 0.0, text="MIS_DIST_1WP"), command("mission_upload", items=far)))
    assert session.acknowledgements[-1].result == CommandAck.ACCEPTED


def test_mission_outside_fence_is_not_started():
    ring = [item("fence_circle_in", 0.0, 0.0, 0.0, radius=5.0)]
    session = in_the_air(command("mission_upload", items=[WAYPOINT]), command("fence_upload", items=ring))
    session.step(commands=(command("mission"),))
    assert session.texts[-1] == "mission: item 1 is outside of the geofence; move the item or the fence"


@pytest.mark.parametrize(
    ("turn", "yaw", "most"),
    [
        (item("yaw", yaw=-4.5, values=(1.0,)), -4.5, 0.1),
        (item("yaw", yaw=-1.0, values=(0.0, 1.0)), 2.0 * math.pi - 1.0, 5.3),
        (item("yaw", yaw=-1.0, values=(0.0, -1.0)), -1.0, 0.1),
        (item("yaw", yaw=-1.0), -1.0, 0.1),
    ],
    ids=["far to the right", "to the left", "to the right", "the shorter way"],
)
def test_turn_goes_by_demanded_way(turn, yaw, most):
    session = in_the_air(command("mission_upload", items=[turn]), command("mission"))
    yaws = [session.step().setpoint.yaw for _ in range(round(10.0 / DT))]
    assert yaws[-1] == pytest.approx(yaw, abs=math.radians(12.0))
    assert min(yaw, 0.0) - 0.1 < min(yaws)
    assert max(yaws) < most


def test_phases_are_words_from_home():
    session = Session(WAITING)
    output = session.step(estimate=GROUND, commands=(command("arm"), command("takeoff", 5.35101)))
    assert output.status.phase == "climb to 5 m up"
    session.run(8.0)
    assert session.step(commands=(command("goto", 1.0, 12.0, 5.35),)).status.phase == "go to 10 m north, 5 m up"
    items = [item("waypoint", -1.5, 2.0, 2.35), item("return")]
    session.step(commands=(command("mission_upload", items=items), command("mission")))
    assert session.run(0.1).status.phase == "item 1 of 2: go to 2.5 m west, 2 m up"
