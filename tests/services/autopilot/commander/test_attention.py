"""A commander that is called only where it has a say asks for the same, to the bit, as one called at every tick."""

import math

import numba
from commander_session import CONSTANTS, VIEW
from hypothesis import example, given, settings
from hypothesis import strategies as st

from services.autopilot.commander.attention import BatteryThresholds, battery_thresholds, needs_attention
from services.autopilot.commander.commander import Commander
from services.autopilot.estimate import EXACT

DT = 0.05  # [s] coarse: time-outs of half a second are ten ticks
LOOK = 5
GPS_LOST, ATTITUDE_UNSURE = 1 << 1, 128
NAMES = ("FS_ESTIMATE_ACT", "FS_MOTOR_ACT", "FS_BAT_EMER_ACT", "FS_BAT_CRIT_ACT", "FS_BAT_LOW_ACT")

SOUND = {"health": 0, "charge": 0.5, "motor": 0, "thrust": 1.0, "cut": False}
"""A flight in which nothing is wrong."""
deviations = st.sampled_from(
    [
        *({"health": bits} for bits in (1, GPS_LOST, GPS_LOST, 64, ATTITUDE_UNSURE, 255)),
        *({"charge": charge} for charge in (math.nan, 0.14, 0.06, 0.04)),
        *({"motor": 2}, {"motor": 2}),
        *({"thrust": 0.3}, {"thrust": 0.0}, {"thrust": 0.0, "cut": True}),
    ]
)
spells = st.tuples(st.integers(1, 40), st.one_of(st.just({}), deviations, st.tuples(deviations, deviations)))
"""A number of ticks, and what is different from a sound flight."""


def constants(actions, delay):
    """Of a vehicle that follows its trajectory without an operator, with these failsafes."""
    values = dict(zip(NAMES, actions, strict=True)) | {"COM_POS_FS_DELAY": delay}
    table = {name: p._replace(default=float(values.get(name, p.default))) for name, p in CONSTANTS.parameters.items()}
    return CONSTANTS._replace(parameters=table, has_trajectory=True, has_operator=False)


def plain(value):
    """Any state as nested lists and tuples, to be compared."""
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    if isinstance(value, dict):
        return [(k, plain(v)) for k, v in value.items()]
    return (type(value).__name__, plain(vars(value))) if hasattr(value, "__dict__") else repr(value)


def views(flight):
    """(view, whether the estimate is due) of each tick; the estimate is that of the last look. Send each request."""
    tick, shown, every_tick = 0, EXACT, False
    for ticks, different in flight:
        now = dict(SOUND)
        for each in different if isinstance(different, tuple) else (different,):
            now |= each
        for _ in range(ticks):
            due = tick % LOOK == 0 or every_tick
            if due:
                shown = EXACT._replace(
                    position_world=(float(tick), 0.1 * tick, 5.0 + 0.01 * tick), health=now["health"]
                )
            view = VIEW._replace(
                dt=DT,
                estimate=shown,
                estimate_interval=(1 if every_tick else LOOK) * DT if due else 0.0,
                battery_charge=now["charge"],
                failed_motor=now["motor"],
                setpoint=VIEW.setpoint._replace(position_world=(0.3 * tick, 1.0, 5.0), yaw=0.01 * tick),
                thrust=now["thrust"],
                motors_cut=now["cut"],
            )
            request = yield view, due
            every_tick = request.estimate_every_tick
            tick += 1


@settings(max_examples=150, deadline=None)
@given(st.lists(spells, min_size=1, max_size=12), st.tuples(*[st.integers(0, 4)] * 5), st.sampled_from([0.1, 0.5, 2.0]))
@example([(7, {}), (3, {"health": GPS_LOST}), (90, {})] * 2, (4,) * 5, 0.1)
@example([(7, {}), (30, {"charge": 0.14}), (9, {})] * 2, (4,) * 5, 0.5)
@example([(7, {}), (5, {"motor": 2}), (9, {})], (0, 3, 0, 0, 0), 0.5)
@example([(40, {"health": 1}), (5, ({"health": 1}, {"motor": 2}))], (0, 3, 0, 0, 0), 0.5)
@example([(7, {}), (5, {"charge": 0.14}), (9, {"thrust": 0.0}), (9, {}), (8, {"charge": 0.14})], (1,) * 5, 0.5)
def test_calls_in_between_change_nothing(flight, actions, delay):
    known = constants(actions, delay)
    always, seldom = Commander(known), Commander(known)
    thresholds = battery_thresholds(seldom.state.guidance.parameters)
    told = views(flight)
    view, due = next(told)
    last = None
    while True:
        v, health = view, view.estimate.health
        wanted = always.step(v)
        quiet = last is not None and last.quiet
        if not quiet or needs_attention(known.autonomous, thresholds, health, v.battery_charge, v.failed_motor, due):
            last = seldom.step(v)
        else:
            assert wanted.setpoint is None
        assert repr(last) == repr(wanted)
        if wanted.status.mode != "mission":
            assert plain(seldom.state) == plain(always.state)
        try:
            view, due = told.send(wanted)
        except StopIteration:
            return


def test_a_sound_flight_along_the_trajectory_is_quiet_and_follows():
    commander = Commander(constants((1,) * 5, 1.0))
    for charge in (math.nan, 0.5):
        request = commander.step(VIEW._replace(battery_charge=charge))
        assert request.quiet
        assert request.setpoint is None
        assert request.texts == request.acknowledgements == ()


def test_what_is_counted_is_not_quiet_and_is_forgotten_once_it_is_over():
    commander = Commander(constants((1,) * 5, 1.0))
    lost = VIEW._replace(estimate=EXACT._replace(health=GPS_LOST))
    assert not commander.step(lost).quiet
    assert commander.step(VIEW).quiet
    requests = [commander.step(lost) for _ in range(round(1.1 / VIEW.dt))]
    assert [r.status.mode for r in requests].index("hold") in (249, 250)
    assert not commander.step(VIEW).quiet  # the trajectory has been left


def test_an_operator_or_no_trajectory_is_never_quiet():
    for trajectory, operator in ((True, True), (False, True), (False, False)):
        known = CONSTANTS._replace(has_trajectory=trajectory, has_operator=operator)
        assert not Commander(known).step(VIEW).quiet
        assert needs_attention(known.autonomous, BatteryThresholds(0.1, 0.1, 0.1), 0, 1.0, 0, False)


def test_it_compiles_into_a_loop():
    @numba.njit
    def first(thresholds, health, charge):
        for tick in range(100):
            if needs_attention(True, thresholds, health, charge - 0.01 * tick, 0, tick % LOOK == 0):
                return tick
        return -1

    thresholds = BatteryThresholds(0.15, 0.07, 0.05)
    assert first(thresholds, 0, 1.0) == 86
    assert first(thresholds, 0, 10.0) == -1
    assert first(BatteryThresholds(0.0, 0.0, 0.5), 0, 0.505) == 1
    assert first(thresholds, GPS_LOST, math.nan) == 0
    assert first(thresholds, 1, math.nan) == -1  # the IMU refused once: not the position
