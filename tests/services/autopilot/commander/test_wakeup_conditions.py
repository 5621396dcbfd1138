"""Outputs of a commander called only at wake-ups: bit-for-bit those of a call at every tick."""

import math

import numba
import pytest
from commander_session import CONSTANTS, VIEW
from flights import command, item
from hypothesis import example, given, settings
from hypothesis import strategies as st

from lapwing.services.autopilot.commander.commander import Commander
from lapwing.services.autopilot.commander.wakeup_conditions import BatteryThresholds, battery_thresholds, needs_wakeup
from lapwing.services.common.ports import StateEstimate

pytestmark = pytest.mark.long

DT = 0.05  # [s] coarse: time-outs of half a second are ten ticks
LOOK = 5
GPS_LOST, ATTITUDE_UNSURE = 1 << 1, 128
NAMES = ("FS_ESTIMATE_ACT", "FS_MOTOR_ACT", "FS_BAT_EMER_ACT", "FS_BAT_CRIT_ACT", "FS_BAT_LOW_ACT")

SOUND = {"health": 0, "charge": 0.5, "motor": 0, "thrust": 1.0, "cut": False}
"""A flight without failures."""
deviations = st.sampled_from(
    [
        *({"health": bits} for bits in (1, GPS_LOST, GPS_LOST, 64, ATTITUDE_UNSURE, 255)),
        *({"charge": charge} for charge in (math.nan, 0.14, 0.06, 0.04)),
        *({"motor": 2}, {"motor": 2}),
        *({"thrust": 0.3}, {"thrust": 0.0}, {"thrust": 0.0, "cut": True}),
    ]
)
spells = st.tuples(st.integers(1, 40), st.one_of(st.just({}), deviations, st.tuples(deviations, deviations)))
"""A number of ticks, and differences to a flight without failures."""

NEAR = [item("fence_circle_in", 0.0, 0.0, radius=20.0)]
PLACES = [item("takeoff", z=3.0), item("waypoint", 4.0, 0.0, 3.0)]
COMMANDS = (
    command("link"),
    command("manual", 0.2, 0.0, 0.1, 0.0),
    command("offboard_position", 1.0, 2.0, 3.0),
    command("parameter", 1.0, text="COM_DL_LOSS_T"),
    command("parameter", 0.6, text="BAT_LOW_THR"),
    command("parameter", 2.0, text="GF_MAX_HOR_DIST"),
    command("parameter", 2.0, text="COM_RC_LOSS_T"),
    command("parameter", 1.0, text="COM_RCL_EXCEPT"),
    command("parameter", 2.0, text="NAV_DLL_ACT"),
    command("fence_upload", items=NEAR),
    command("mission_upload", items=PLACES),
    command("mission_current", 1.0),
    command("set_home", 1.0, 2.0, 0.0),
    command("gripper", 0.0),
    command("finish"),
    command("arm", math.nan, 2.0, id=4),
    command("disarm", id=5),
    command("hold"),
    command("goto", 4.0, 1.0, 5.0),
    command("return"),
    command("offboard"),
)
orders = st.dictionaries(st.integers(0, 150), st.lists(st.sampled_from(COMMANDS), min_size=1, max_size=2), max_size=12)
"""Return the commands by tick."""


def constants(actions, delay, operator=False):
    """Return the constants of a vehicle that follows its trajectory, with these failsafes."""
    values = dict(zip(NAMES, actions, strict=True)) | {"COM_POS_FS_DELAY": delay}
    table = {name: p._replace(default=float(values.get(name, p.default))) for name, p in CONSTANTS.parameters.items()}
    return CONSTANTS._replace(parameters=table, has_trajectory=True, has_operator=operator)


def plain(value):
    """Return a state as nested lists and tuples, for comparisons."""
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    if isinstance(value, dict):
        return [(k, plain(v)) for k, v in value.items()]
    return (type(value).__name__, plain(vars(value))) if hasattr(value, "__dict__") else repr(value)


def views(flight, orders=()):
    """Yield each tick's view and True if its estimate is new. Send the commander's output back to the generator."""
    tick, last_estimate, every_tick = 0, StateEstimate(), False
    for ticks, different in flight:
        now = dict(SOUND)
        for each in different if isinstance(different, tuple) else (different,):
            now |= each
        for _ in range(ticks):
            due = tick % LOOK == 0 or every_tick
            if due:
                last_estimate = StateEstimate(
                    position_world=(float(tick), 0.1 * tick, 5.0 + 0.01 * tick), health=now["health"]
                )
            view = VIEW._replace(
                dt=DT,
                estimate=last_estimate,
                estimate_interval=(1 if every_tick else LOOK) * DT if due else 0.0,
                battery_charge=now["charge"],
                failed_motor=now["motor"],
                setpoint=VIEW.setpoint._replace(position_world=(0.3 * tick, 1.0, 5.0), yaw=0.01 * tick),
                thrust=now["thrust"],
                motors_cut=now["cut"],
                commands=tuple(orders[tick]) if tick in orders else (),
            )
            request = yield view, due
            every_tick = request.estimate_every_tick
            tick += 1


def skip(commander, missed):
    """Advance a commander over views without a call."""
    flies = [view.thrust > 0.0 and not view.motors_cut for view in missed]
    flew = [view.setpoint for view, flying in zip(missed, flies, strict=True) if flying]
    commander.skip(len(missed), DT, flies[-1], flew[-1] if flew else None)


NO_MESSAGES = {"acknowledgements": (), "texts": (), "parameters": None, "faults": None}
"""Outputs that are sent only once."""


def check_same(vehicle, flight, orders=()):
    """Check that calls at every tick and calls only at wake-ups have the same outputs."""
    dense, sparse = Commander(vehicle), Commander(vehicle)
    reported = views(flight, orders)
    view, due = next(reported)
    last, until, missed = None, 0.0, []
    while True:
        expected = dense.step(view)
        thresholds = battery_thresholds(sparse.state.guidance.parameters)
        conditions = view.estimate.health, view.battery_charge, view.failed_motor, due
        operated = vehicle.has_operator and (due or view.commands)
        if len(missed) + 1 >= until or operated or needs_wakeup(thresholds, *conditions):
            if vehicle.has_operator and missed:
                skip(sparse, missed)
            last = sparse.step(view)
            missed, until = [], last.valid_for / DT if last.valid_for < math.inf else math.inf
            assert last.valid_for == 0.0 or last.setpoint is None
        else:
            missed.append(view)
            assert expected.acknowledgements == expected.texts == ()
        assert repr(last._replace(valid_for=0.0, **NO_MESSAGES)) == repr(
            expected._replace(valid_for=0.0, **NO_MESSAGES)
        )
        if not missed:
            assert (last.acknowledgements, last.texts) == (expected.acknowledgements, expected.texts)
            if vehicle.has_operator or expected.status.mode != "mission":
                assert plain(sparse.state) == plain(dense.state)
        try:
            view, due = reported.send(expected)
        except StopIteration:
            return


@pytest.mark.nightly
@settings(max_examples=150, deadline=None)
@given(st.lists(spells, min_size=1, max_size=12), st.tuples(*[st.integers(0, 4)] * 5), st.sampled_from([0.1, 0.5, 2.0]))
@example([(7, {}), (3, {"health": GPS_LOST}), (90, {})] * 2, (4,) * 5, 0.1)
@example([(7, {}), (30, {"charge": 0.14}), (9, {})] * 2, (4,) * 5, 0.5)
@example([(7, {}), (5, {"motor": 2}), (9, {})], (0, 3, 0, 0, 0), 0.5)
@example([(40, {"health": 1}), (5, ({"health": 1}, {"motor": 2}))], (0, 3, 0, 0, 0), 0.5)
@example([(7, {}), (5, {"charge": 0.14}), (9, {"thrust": 0.0}), (9, {}), (8, {"charge": 0.14})], (1,) * 5, 0.5)
def test_extra_calls_do_not_change_output(flight, actions, delay):
    check_same(constants(actions, delay), flight)


SHORT_LINK = {3: [COMMANDS[0]], 5: [COMMANDS[3], COMMANDS[5]]}


@settings(max_examples=300, deadline=None)
@given(
    st.lists(spells, min_size=1, max_size=8), st.tuples(*[st.integers(0, 4)] * 5), st.sampled_from([0.1, 2.0]), orders
)
@example([(150, {})], (4,) * 5, 0.1, SHORT_LINK)
@example([(150, {})], (4,) * 5, 0.1, {8: [command("offboard_position", 1.0, 2.0, 3.0)]})
@example([(150, {})], (4,) * 5, 0.1, {6: [command("fence_upload", items=NEAR)]})
@example([(12, {}), (60, {"thrust": 0.0}), (40, {})], (4,) * 5, 0.1, {7: [command("mission_upload", items=PLACES)]})
@example([(12, {}), (3, {"thrust": 0.0}), (40, {})], (4,) * 5, 0.1, {14: [command("hold")]})
@example([(12, {}), (30, {"thrust": 0.0, "cut": True})], (4,) * 5, 0.1, {19: [command("hold")]})
@example([(60, {})], (4,) * 5, 0.1, {17: [command("goto", 4.0, 1.0, 5.0)]})
@example([(60, {"thrust": 0.0, "health": 1})], (4,) * 5, 0.1, {27: [command("arm", math.nan, 1.0)]})
@example([(60, {})], (4,) * 5, 0.1, {17: [command("parameter", 0.6, text="BAT_LOW_THR")]})
def test_extra_calls_with_operator_do_not_change_output(flight, actions, delay, orders):
    check_same(constants(actions, delay, operator=True), flight, orders)


def test_nominal_trajectory_flight_needs_no_wakeup():
    for operator in (False, True):
        commander = Commander(constants((1,) * 5, 1.0, operator))
        for charge in (math.nan, 0.5):
            request = commander.step(VIEW._replace(battery_charge=charge))
            assert request.valid_for == math.inf
            assert request.setpoint is None
            assert request.texts == request.acknowledgements == ()


def test_delay_of_failsafe_limits_validity():
    commander = Commander(constants((1,) * 5, 1.0))
    lost = VIEW._replace(estimate=StateEstimate(health=GPS_LOST))
    assert not commander.step(lost).valid_for
    assert commander.step(VIEW).valid_for
    requests = [commander.step(lost) for _ in range(round(1.1 / VIEW.dt))]
    assert [r.status.mode for r in requests].index("hold") in (249, 250)
    assert not commander.step(VIEW).valid_for  # no longer on the trajectory


def test_next_wakeup_is_link_or_setpoint_timeout():
    vehicle = constants((1,) * 5, 1.0, operator=True)
    timeout = {name: vehicle.parameters[name].default for name in ("COM_DL_LOSS_T", "COM_OF_LOSS_T")}
    linked = Commander(vehicle).step(VIEW._replace(commands=(command("link"),)))
    assert linked.valid_for == timeout["COM_DL_LOSS_T"] - VIEW.dt
    offboard = Commander(vehicle).step(VIEW._replace(commands=(command("offboard_position", 1.0, 2.0, 3.0),)))
    assert offboard.valid_for == timeout["COM_OF_LOSS_T"] - VIEW.dt


def test_commander_without_trajectory_runs_every_tick():
    for operator in (True, False):
        assert not Commander(CONSTANTS._replace(has_trajectory=False, has_operator=operator)).step(VIEW).valid_for


def test_wakeup_conditions_compile_into_loop():
    @numba.njit
    def first(thresholds, health, charge):
        for tick in range(100):
            if needs_wakeup(thresholds, health, charge - 0.01 * tick, 0, tick % LOOK == 0):
                return tick
        return -1

    thresholds = BatteryThresholds(0.15, 0.07, 0.05)
    assert first(thresholds, 0, 1.0) == 86
    assert first(thresholds, 0, 10.0) == -1
    assert first(BatteryThresholds(0.0, 0.0, 0.5), 0, 0.505) == 1
    assert first(thresholds, GPS_LOST, math.nan) == 0
    assert first(thresholds, 1, math.nan) == -1  # one rejected IMU reading; the position is not lost
