"""Injected failures in flight: reactions of the estimator and of the failsafes."""

import math

import numpy as np
import pytest
from flights import (
    ACCEPTED,
    DENIED,
    ENABLED,
    OPERATED,
    RATE,
    UP,
    at,
    command,
    error,
    fly,
    fly_by_sensors,
    height,
    inject,
    mode,
    place,
    results,
    scripted,
    sent_texts,
)

from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.cosim.executors.single_process import KEPT_TICKS
from lapwing.services.autopilot.failure_injection.failure_state import DELAY, SLOWED
from lapwing.services.common.failure_types import (
    DELAYED,
    GARBAGE,
    INTERMITTENT,
    KINDS,
    OF_SYSTEMS,
    OFF,
    SLOW,
    SOUND,
    STUCK,
    UNITS,
    WRONG,
)
from lapwing.services.process_table import create_all
from lapwing.services.scene_resolver import load, resolve
from tests.combinations import rest_nightly
from tests.cosim import memory_log

pytestmark = pytest.mark.long

SENSORS = ("imu", "magnetometer", "gps", "barometer", "sonar", "optical_flow", "airspeed")
LOOKING = ["sensors.optical_flow.preset=pmw3901", "sensors.airspeed.preset=sdp33"]  # not in the scene


def rejected(flight, start, source):
    """Return the share of estimates after `start` [s] with a rejected or missing source."""
    result = flight.column("estimate", lambda m: source in m.rejected_sources)[flight.times("estimate") >= start]
    return float(np.mean(result))


def enable(value, id=0):
    return command("parameter", value, text="SYS_FAILURE_EN", id=id)


def test_injection_needs_parameter_and_present_unit():
    script = {0.04: [inject("motor", OFF, id=1)], 0.1: [enable(1.0, id=2)]}
    script[0.2] = [inject("motor", OFF, id=3), inject("gps", OFF, id=4), inject("battery", SLOW, id=5)]
    script[0.24] = [inject("motor", DELAYED, id=9), inject("motor", OFF, 5, id=10)]
    script[0.3] = [inject("motor", SOUND, id=6), enable(0.0, id=7)]
    motor = UNITS.index("motor")
    script[0.24] += [command("inject_failure", motor, OFF, math.nan, bits, id=k) for k, bits in ((11, 5.0), (12, 16.0))]
    script[0.4] = [inject("motor", OFF, id=8)]
    flight = fly(0.6, script, "autopilot.parameters.SYS_FAILURE_EN=0")
    refused = dict.fromkeys((1, 4, 5, 8, 9, 10, 12), DENIED)
    expected = dict.fromkeys((2, 3, 6, 7, 11), ACCEPTED) | refused
    assert {k: v for k, v in results(flight).items() if k} == expected
    assert sent_texts(flight)[:8] == [
        "inject failure: SYS_FAILURE_EN is 0; set it to 1 first", "injected: motor off",
        "inject failure: the vehicle has no gps", "inject failure: battery can be sound, off, stuck, wrong",
        "inject failure: motor can be sound, off, stuck, wrong, slow",
        "inject failure: motor 5 does not exist; expected 1 to 4, 0 for all", "injected: motor 1, 3 off",
        "inject failure: motor 5 does not exist; expected 1 to 4, 0 for all",
    ]  # fmt: skip


FAILING = [unit for unit in UNITS if unit not in OF_SYSTEMS]


def received(kind, seconds=4.0, start=1.0):
    """Return the outputs of sensors and estimator on the ground if every sensor fails in one way from `start` [s]."""
    scene = load("groundstation", [ENABLED, *LOOKING, "autopilot.follow_trajectory=false", f"run.duration={seconds}"])
    config = resolve(scene)
    operator = scripted({start: [inject(unit, kind, id=k + 1) for k, unit in enumerate(FAILING)]})
    diagram = BlockDiagram(
        config, create_all(config, operator), KEPT_TICKS, [*SENSORS, *(f"{name}.received" for name in SENSORS)]
    )
    diagram.advance(config.last_tick + 1)
    for name in SENSORS:
        period = diagram.ports[name].period
        rows = [diagram.history(port, period) for port in (name, f"{name}.received")]
        first = -(-round(start * RATE) // period) + 1  # the first reading that is certainly affected
        yield name, round(DELAY * RATE / period), first, *rows


# Number of leading values of a reading
VALUES = {"imu": 6, "magnetometer": 3, "gps": 3, "barometer": 1, "sonar": 1, "optical_flow": 2, "airspeed": 1}
# Column of `valid` if it is not the last
VALID = {"gps": 11}


@pytest.mark.parametrize("kind", [OFF, STUCK, GARBAGE, WRONG, SLOW, DELAYED, INTERMITTENT], ids=KINDS[1:])
def test_received_reading_follows_failure_type(kind):
    for name, late, first, sent, actual in received(kind):
        assert np.array_equal(sent[: first - 1], actual[: first - 1])  # valid before the failure
        there, numbers = actual[first:, VALID.get(name, -1)] > 0.0, slice(0, VALUES[name])
        sent_then, got_then = sent[first:, numbers], actual[first:, numbers]
        if kind == OFF:
            assert not there.any()
        elif kind == STUCK:
            assert there.all()
            assert (got_then == sent[first - 1, numbers]).all()
        elif kind == DELAYED:
            assert np.array_equal(actual[first:], sent[first - late : len(sent) - late])
        elif kind == SLOW:
            assert there.sum() == pytest.approx(len(there) / SLOWED, abs=1.0)
            assert np.array_equal(got_then[there], sent_then[there])
        elif kind == INTERMITTENT:
            assert 0 < there.sum() < len(there)
            assert np.array_equal(got_then[there], sent_then[there])
        elif kind == GARBAGE:
            assert there.all()
            assert len(np.unique(got_then)) == got_then.size  # no repeated reading
            assert np.median(np.abs(got_then - sent_then)) > 10.0 * np.median(np.abs(sent_then - sent_then.mean(0)))
        else:
            assert there.all()
            assert (got_then != sent_then).any(axis=1).all()


def test_battery_off_failure_reads_empty_and_lands():
    flight = fly(8, UP | {6: [inject("battery", OFF)]}, ENABLED)
    assert "the battery is nearly empty: land" in sent_texts(flight)
    assert at(flight, "status", 8.0, lambda m: m.battery_warning) == 3


def test_motor_off_failure_is_detected():
    flight = fly(6.6, UP | {6: [inject("motor", OFF, 3)]}, ENABLED)
    assert at(flight, "status", 6.5, lambda m: m.failed_motor) == 3
    assert any("a motor has failed" in text for text in sent_texts(flight))
    volts = voltages(flight, 6.1)
    assert set(volts[:, 2]) == {0.0}
    assert volts[:, 0].max() > 1.0


def voltages(flight, start):
    """Return the motor voltages [V] after `start` [s]."""
    return flight.column("actuators", lambda m: tuple(m.motor_voltage))[flight.times("actuators") > start]


def test_stuck_motor_keeps_speed_and_others_compensate():
    flight = fly(9, UP | {6: [inject("motor", STUCK, 3)], 6.5: [command("goto", 0.0, 0.0, 3.3)]}, ENABLED)
    volts = voltages(flight, 6.1)
    assert len(set(volts[:, 2])) == 1
    assert volts[0, 2] > 1.0
    assert len(set(volts[:, 0])) > 10
    assert height(flight, 8.0) > 2.0


def test_weak_motor_is_detected_and_vehicle_lands_upright():
    flight = fly(16, UP | {6: [inject("motor", WRONG, 3)]}, ENABLED)
    assert "a motor has failed: land" in sent_texts(flight)
    assert at(flight, "status", 7.0, lambda m: m.failed_motor) == 3  # theory, eq. (4.26b): 0.88 s for a loss of 45 %
    sound = flight.column("actuators", lambda m: tuple(m.motor_voltage))[flight.times("actuators") < 5.9][-1]
    assert voltages(flight, 6.02)[0, 2] < 0.9 * sound[2]  # the voltage at the weak motor; the controller commands more
    assert height(flight, 7.0) > 2.0
    assert math.dist(place(flight, 16.0)[:2], (0.0, 0.0)) < 0.5
    assert not at(flight, "status", 16.0, lambda m: m.armed)


def test_motor_failure_can_stop_the_motors():
    flight = fly(7.5, UP | {6: [inject("motor", OFF, 3)]}, ENABLED, "autopilot.parameters.FS_MOTOR_ACT=5")
    assert "disarmed: a motor has failed" in sent_texts(flight)
    assert not at(flight, "status", 6.5, lambda m: m.armed)
    assert set(voltages(flight, 6.5).ravel()) == {0.0}


def test_slow_motor_follows_every_twentieth_command():
    flight = fly(8, UP | {6: [inject("motor", SLOW)], 6.2: [command("goto", 0.0, 0.0, 3.3)]}, ENABLED)
    changes = np.flatnonzero(np.diff(voltages(flight, 6.3)[:, 0]) != 0.0)
    assert len(changes) > 10
    assert set(np.diff(changes) % SLOWED) == {0}
    assert height(flight, 8.0) > 2.0


def test_repaired_motors_respond_immediately():
    flight = fly(8, UP | {6: [inject("motor", STUCK)], 6.1: [inject("motor", SOUND, 2, id=8)]}, ENABLED)
    volts = voltages(flight, 6.2)
    assert len(set(volts[:, 0])) == 1
    assert len(set(volts[:, 1])) > 10


@pytest.mark.parametrize(
    ("level", "text"),
    [(1, "the battery is low"), (2, "the battery is critical: return"), (3, "the battery is nearly empty: land")],
)
def test_wrong_battery_reports_charge_of_parameter(level, text):
    flight = fly(7, UP | {6: [inject("battery", WRONG)]}, ENABLED, f"autopilot.parameters.SYS_FAIL_BAT_LVL={level}")
    assert at(flight, "status", 6.9, lambda m: m.battery_warning) == level
    assert text in sent_texts(flight)


def test_stuck_battery_does_not_warn():
    emptying = [ENABLED, "effects.battery.initial_charge=0.1502"]
    sound, stuck = fly(12, UP, *emptying), fly(12, UP | {0.1: [inject("battery", STUCK)]}, *emptying)
    assert "the battery is low" in sent_texts(sound)
    assert "the battery is low" not in sent_texts(stuck)
    assert at(stuck, "battery", 12.0, lambda m: m.percentage) < 0.15  # as published by the pack


def fly_hexacopter(duration, script):
    """Return a flight of a hexacopter under scripted commands; rotor damage begins after its end."""
    overrides = ["autopilot.estimator=ground_truth", "effects.rotor_damage.time=99.0", f"run.duration={duration}"]
    return memory_log.fly(load("hexacopter", [ENABLED, *OPERATED, *overrides]), scripted(script))


def test_each_of_six_motors_can_fail():
    script = {0.04: [command("takeoff", 3.0), command("arm")], 6: [inject("motor", OFF, 6)]}
    flight = fly_hexacopter(7, script)
    assert at(flight, "status", 6.9, lambda m: m.failed_motor) == 6
    assert set(voltages(flight, 6.1)[:, 5]) == {0.0}
    assert height(flight, 6.9) > 2.0


def test_repaired_motor_returns_to_the_allocation():
    """PX4's client tests switch each motor off for a second and on again."""
    script = {0.04: [command("takeoff", 3.0), command("arm")]}
    for k in range(1, 7):
        script[5.0 + k] = [inject("motor", OFF, k, id=10 + k)]
        script[5.5 + k] = [inject("motor", SOUND, k, id=20 + k)]
    flight = fly_hexacopter(13, script)
    for k in range(1, 7):
        assert at(flight, "status", 5.4 + k, lambda m: m.failed_motor) == k
        assert at(flight, "status", 5.9 + k, lambda m: m.failed_motor) == 0
    assert voltages(flight, 12.9).min() > 1.0
    assert abs(height(flight, 13.0) - 3.0) < 1.0


def test_lost_gps_descends_then_holds_on_recovery():
    script = {14: [inject("gps", OFF)], 27: [inject("gps", SOUND, id=8)]}
    flight = fly_by_sensors(
        31, script, ENABLED, "autopilot.parameters.MPC_LAND_SPEED=0.2", "autopilot.parameters.MIS_TAKEOFF_ALT=4"
    )
    reported = sent_texts(flight)
    assert reported.index("injected: gps off") < reported.index("the position is lost: descend in 9 s")
    assert mode(flight, 24.5) == "descend"
    assert mode(flight, 30.5) == "hold"


@pytest.mark.parametrize(
    ("unit", "kind"),
    rest_nightly(
        ("gps", GARBAGE),
        ("magnetometer", STUCK),
        ("barometer", WRONG),
        ("distance_sensor", OFF),
        *[("gps", kind) for kind in (STUCK, WRONG)],
        *[("magnetometer", kind) for kind in (OFF, GARBAGE, WRONG)],
        *[("barometer", kind) for kind in (OFF, STUCK, GARBAGE)],
        *[("distance_sensor", kind) for kind in (GARBAGE, WRONG)],
        keep=4,
    ),
    ids=lambda value: value if isinstance(value, str) else KINDS[value],
)
def test_failed_sensor_is_rejected_and_flight_continues(unit, kind):
    flight = fly_by_sensors(13, {9: [inject(unit, kind)]}, ENABLED)
    assert results(flight)[7] == ACCEPTED
    assert rejected(flight, 10.0, {"distance_sensor": "sonar"}.get(unit, unit)) > 0.5
    assert error(flight, 9.0) < (3.0 if (unit, kind) == ("gps", GARBAGE) else 1.0)  # a few may pass the gate
    assert math.dist(place(flight, 13.0)[:2], place(flight, 9.0)[:2]) < 1.5


@pytest.mark.parametrize("kind", rest_nightly(SLOW, DELAYED, INTERMITTENT), ids=lambda kind: KINDS[kind])
@pytest.mark.parametrize("units", [("gps", "magnetometer"), ("barometer", "distance_sensor")])
def test_remaining_readings_are_fused(units, kind):
    flight = fly_by_sensors(13, {9: [inject(unit, kind, id=k + 1) for k, unit in enumerate(units)]}, ENABLED)
    assert error(flight, 9.0) < 0.2
    if kind != DELAYED:
        names = ["sonar" if unit == "distance_sensor" else unit for unit in units]
        assert all(0.1 < rejected(flight, 10.0, name) < 1.0 for name in names)


@pytest.mark.parametrize("kind", rest_nightly(OFF, STUCK, GARBAGE, SLOW, DELAYED), ids=lambda kind: KINDS[kind])
@pytest.mark.parametrize("unit", ["accelerometer", "gyro"])
def test_vehicle_drifts_without_inertial_sensor(unit, kind):
    flight = fly_by_sensors(15.5, {9: [inject(unit, kind)]}, ENABLED)
    assert math.dist(place(flight, 15.5), place(flight, 9.0)) > 1.0
    if unit == "gyro" or kind in (OFF, SLOW):  # the vehicle tumbles
        reported = sent_texts(flight)
        after = reported[reported.index(f"injected: {unit} {KINDS[kind]}") + 1 :]
        assert {"a motor has failed: land", "the position is lost: descend in 9 s"} & set(after)


@pytest.mark.parametrize("unit", ["accelerometer", "gyro"])
def test_imu_bias_is_detected_and_outage_bridged(unit):
    biased = fly_by_sensors(13, {9: [inject(unit, WRONG)]}, ENABLED)
    assert 0.05 < error(biased, 9.0) < 3.0
    assert place(biased, 13.0)[2] > 2.0
    interrupted = fly_by_sensors(13, {9: [inject(unit, INTERMITTENT)]}, ENABLED)
    assert error(interrupted, 9.0) < 0.3
