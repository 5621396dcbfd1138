"""Failures that an operator injects: each flown, and what the estimator and the failsafes make of it."""

import math

import numpy as np
import pytest
from flights import ACCEPTED, DENIED, UP, at, command, fly, mode, place, results, said, scripted

from services.common.failures import OFF, SLOW, SOUND, STUCK, UNITS, WRONG
from services.table import load
from tests.cosim import memory_log

ENABLED = "autopilot.parameters.SYS_FAILURE_EN=1"
UP_BY_SENSORS = {0.04: [command("takeoff", 4.0), command("arm", float("nan"), 10.0)]}


def inject(unit, kind, motor=0, id=7):
    return command("inject_failure", UNITS.index(unit), kind, motor, id=id)


def fly_by_sensors(seconds, script, *sets):
    scene = load("groundstation", [ENABLED, "autopilot.trajectory=false", f"run.duration={seconds}", *sets])
    return memory_log.fly(scene, scripted(UP_BY_SENSORS | script))


def error(flown, start):
    """Largest distance [m] of the estimate from the truth from a time on."""
    known, true = (flown.column(t, lambda m: tuple(m.pose.position)) for t in ("estimate", "truth"))
    times, true_times = flown.times("estimate"), flown.times("truth")
    nearest = true[np.searchsorted(true_times, times).clip(0, len(true) - 1)]
    return np.linalg.norm(known - nearest, axis=1)[times >= start].max()


def rejected(flown, start, source):
    """Share of the estimates from a time on in which a source was refused or missing."""
    found = flown.column("estimate", lambda m: source in m.rejected)[flown.times("estimate") >= start]
    return float(np.mean(found))


@pytest.mark.parametrize("parameter", [0, 1])
def test_it_is_guarded_and_knows_what_there_is(parameter):
    script = {0.04: [inject("motor", OFF, id=1), inject("gps", OFF, id=2), inject("battery", STUCK, id=3)]}
    script[0.2] = [inject("motor", SOUND, id=4), command("parameter", 0.0, text="SYS_FAILURE_EN")]
    script[0.4] = [inject("motor", OFF, id=5)]
    flown = fly(0.6, script, f"autopilot.parameters.SYS_FAILURE_EN={parameter}")
    expected = (
        {1: ACCEPTED, 2: DENIED, 3: DENIED, 4: ACCEPTED, 5: DENIED} if parameter else dict.fromkeys(range(1, 6), DENIED)
    )
    assert {k: v for k, v in results(flown).items() if k} == expected
    if parameter:
        assert said(flown)[:3] == [
            "injected: motor off", "inject failure: there is no gps", "inject failure: a battery can only be off",
        ]  # fmt: skip


def test_a_battery_that_is_off_reads_empty_and_the_vehicle_lands():
    flown = fly(8, UP | {6: [inject("battery", OFF)]}, ENABLED)
    assert "the battery is nearly empty: land" in said(flown)
    assert at(flown, "status", 8.0, lambda m: m.battery_warning) == 3


def test_a_motor_that_is_off_is_noticed():
    flown = fly(6.6, UP | {6: [inject("motor", OFF, 3)]}, ENABLED)
    assert at(flown, "status", 6.5, lambda m: m.failed_motor) == 3
    assert any("a motor has failed" in text for text in said(flown))
    volts = flown.column("actuators", lambda m: tuple(m.motor_voltage))[flown.times("actuators") > 6.1]
    assert set(volts[:, 2]) == {0.0}
    assert volts[:, 0].max() > 1.0


def test_without_gps_it_warns_and_descends_and_holds_once_it_is_back():
    script = {14: [inject("gps", OFF)], 27: [inject("gps", SOUND, id=8)]}
    flown = fly_by_sensors(
        31, script, "autopilot.parameters.MPC_LAND_SPEED=0.2", "autopilot.parameters.MIS_TAKEOFF_ALT=4"
    )
    told = said(flown)
    assert told.index("injected: gps off") < told.index("the position is lost: descend in 9 s")
    assert mode(flown, 24.5) == "descend"
    assert mode(flown, 30.5) == "hold"


@pytest.mark.parametrize(
    ("unit", "kind", "source"),
    [
        ("gps", STUCK, "gps"),
        ("gps", WRONG, "gps"),
        ("magnetometer", OFF, "magnetometer"),
        ("magnetometer", WRONG, "magnetometer"),
        ("barometer", STUCK, "barometer"),
        ("barometer", WRONG, "barometer"),
        ("sonar", OFF, "sonar"),
        ("sonar", WRONG, "sonar"),
    ],
)
def test_a_sensor_that_fails_is_refused_and_the_others_carry_on(unit, kind, source):
    flown = fly_by_sensors(19, {14: [inject(unit, kind)]})
    assert results(flown)[7] == ACCEPTED
    assert rejected(flown, 16.0, source) > 0.5
    assert error(flown, 14.0) < 1.0
    assert math.dist(place(flown, 19.0)[:2], place(flown, 14.0)[:2]) < 1.5


@pytest.mark.parametrize(("reference", "least", "most"), [(0, 0.03, 0.1), (1, 0.005, 0.02)])
def test_the_height_comes_from_where_the_parameter_says(reference, least, most):
    up = {0.04: [command("takeoff", 15.0), command("arm", float("nan"), 10.0)]}  # beyond the sonar's reach
    sets = [f"EKF2_HGT_REF={reference}", "MPC_TKO_SPEED=3"]
    flown = fly_by_sensors(20, up, *[f"autopilot.parameters.{each}" for each in sets])
    spread = flown.column("estimate", lambda m: m.position_std.z)[flown.times("estimate") > 17.0].mean()
    assert least < spread < most  # the barometer knows less
    assert error(flown, 15.0) < 0.3


def test_a_slow_sensor_is_taken_in_where_it_speaks():
    flown = fly_by_sensors(19, {14: [inject("gps", SLOW), inject("magnetometer", SLOW, id=8)]})
    assert 0.1 < rejected(flown, 16.0, "magnetometer") < 1.0
    assert error(flown, 14.0) < 1.0


@pytest.mark.parametrize(("unit", "kind"), [("accelerometer", WRONG), ("gyro", WRONG)])
def test_an_inertial_sensor_that_is_off_by_a_bias_is_learned_or_not_survived(unit, kind):
    flown = fly_by_sensors(17, {14: [inject(unit, kind)]})
    assert results(flown)[7] == ACCEPTED
    assert error(flown, 14.0) > 0.05  # it is felt
