"""Commander without a controller: outputs by tick, and completeness of its state."""

import copy
import pickle

import pytest
from commander_session import CONSTANTS, DT, HIGH, Session
from flights import command, item

from lapwing.messages import CommandAck
from lapwing.services.autopilot.commander.commander import Commander
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
    assert session.texts[-1] == "item 0: expected a take-off to at most 1000 m"
