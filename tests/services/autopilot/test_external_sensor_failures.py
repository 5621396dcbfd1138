"""Injected failures of rangefinder, optical flow and airspeed sensor."""

import math

import numpy as np
import pytest
from flights import (
    ACCEPTED,
    DENIED,
    ENABLED,
    NAN,
    command,
    error,
    fly,
    fly_by_sensors,
    height,
    inject,
    mode,
    place,
    results,
    sent_texts,
)

from lapwing.services.autopilot.failure_injection.failure_state import SLOWED
from lapwing.services.autopilot.failure_injection.reading_failures import EXCESS_DYNAMIC, EXCESS_RANGE
from lapwing.services.autopilot.schema import NEEDED
from lapwing.services.common.failure_types import DELAYED, GARBAGE, INTERMITTENT, KINDS, OFF, SLOW, STUCK, WRONG
from tests.combinations import rest_nightly

pytestmark = pytest.mark.long

FLOW, TUBE = "sensors.optical_flow.preset=pmw3901", "sensors.airspeed.preset=sdp33"
UP_TO_3 = [command("takeoff", 3.0), command("arm", NAN, 10.0)]
ALL = [OFF, STUCK, GARBAGE, WRONG, SLOW, DELAYED, INTERMITTENT]


def rejected(flight, start, source):
    """Return the share of estimates after `start` [s] with a rejected or missing source."""
    result = flight.column("estimate", lambda m: source in m.rejected_sources)[flight.times("estimate") >= start]
    return float(np.mean(result))


def by_flow(kind):
    """Return a flight with a failure of the receiver, and then of the optical flow that replaces it."""
    script = {9: [inject("gps", OFF)], 13: [inject("optical_flow", kind, id=8)]}
    flight = fly_by_sensors(26, script, ENABLED, FLOW)
    assert results(flight)[8] == ACCEPTED
    return flight


@pytest.mark.parametrize("kind", rest_nightly(OFF, STUCK, GARBAGE, WRONG), ids=lambda kind: KINDS[kind])
def test_failed_flow_without_gps_causes_descent(kind):
    flight = by_flow(kind)
    assert rejected(flight, 14.0, "optical_flow") > 0.9
    reported = sent_texts(flight)
    assert reported.index(f"injected: optical_flow {KINDS[kind]}") < reported.index(
        "the position is lost: descend in 9 s"
    )
    assert mode(flight, 26.0) == "descend"


@pytest.mark.parametrize("kind", rest_nightly(SLOW, DELAYED, INTERMITTENT), ids=lambda kind: KINDS[kind])
def test_remaining_flow_readings_sustain_flight(kind):
    flight = by_flow(kind)
    assert mode(flight, 26.0) == "hold"
    assert math.dist(place(flight, 26.0), place(flight, 13.0)) < 2.0
    assert error(flight, 9.0) < 1.5


@pytest.mark.parametrize("kind", rest_nightly(*ALL, keep=2), ids=lambda kind: KINDS[kind])
def test_failed_flow_with_gps_does_not_affect_flight(kind):
    flight = fly_by_sensors(13, {9: [inject("optical_flow", kind)]}, ENABLED, FLOW)
    sound = fly_by_sensors(13, {}, ENABLED, FLOW)
    assert place(flight, 13.0) == place(sound, 13.0)
    missing = rejected(flight, 10.0, "optical_flow")
    assert missing == pytest.approx(
        {OFF: 1.0, STUCK: 1.0, SLOW: 1.0 - 1.0 / SLOWED, INTERMITTENT: 0.5}.get(kind, 0.0), abs=0.25
    )


@pytest.mark.parametrize("kind", rest_nightly(OFF, GARBAGE, WRONG), ids=lambda kind: KINDS[kind])
def test_rangefinder_that_looks_down_fails_as_distance_sensor(kind):
    sensors = [f"sensors.{name}={{}}" for name in (*NEEDED, "barometer")]
    laser = ["sensors.rangefinder.preset=lidar_lite_v3"]
    script = {0.04: UP_TO_3, 8: [inject("distance_sensor", kind)]}
    flight = fly(13, script, ENABLED, "autopilot.estimator=kalman", *sensors, *laser)
    assert results(flight)[7] == ACCEPTED
    assert rejected(flight, 9.0, "sonar") > 0.5
    assert height(flight, 13.0) == pytest.approx(height(flight, 8.0), abs=0.3)


def test_wrong_distance_is_followed_as_height_reference():
    flight = fly_by_sensors(13, {8: [inject("distance_sensor", WRONG)]}, ENABLED, "autopilot.parameters.EKF2_HGT_REF=2")
    assert height(flight, 13.0) == pytest.approx(height(flight, 8.0) - EXCESS_RANGE, abs=0.1)


def test_stuck_distance_does_not_prevent_climb():
    script = {8: [inject("distance_sensor", STUCK)], 9: [command("goto", 0.0, 0.0, 6.0, 0.0, 2.0)]}
    flight = fly_by_sensors(14, script, ENABLED)
    assert height(flight, 14.0) == pytest.approx(6.0, abs=0.1)
    assert error(flight, 9.0) < 0.1


def test_rangefinder_that_autopilot_does_not_read_cannot_fail():
    sensors = [f"sensors.{name}={{}}" for name in (*NEEDED, "barometer")]
    ahead = ["sensors.rangefinder.preset=lidar_lite_v3", "sensors.rangefinder.elevation_deg=0"]
    script = {0.1: [inject("distance_sensor", OFF)]}
    flight = fly(0.3, script, ENABLED, "autopilot.estimator=kalman", *sensors, *ahead)
    assert results(flight)[7] == DENIED
    assert "inject failure: the vehicle has no distance_sensor" in sent_texts(flight)


@pytest.mark.parametrize("kind", rest_nightly(*ALL, keep=2), ids=lambda kind: KINDS[kind])
def test_failed_airspeed_is_reported_and_not_used(kind):
    flight = fly_by_sensors(12, {9: [inject("airspeed", kind)]}, ENABLED, TUBE)
    assert results(flight)[7] == ACCEPTED
    after = flight.times("differential_pressure") > 9.1
    read, actual = (
        flight.column(name, lambda m: m.fluid_pressure)[after]
        for name in ("differential_pressure", "differential_pressure/received")
    )
    there = np.isfinite(actual)
    assert np.isfinite(read).all()
    if kind == OFF:
        assert not there.any()
    elif kind == STUCK:
        assert len(set(actual)) == 1
    elif kind == WRONG:
        assert actual == pytest.approx(read + EXCESS_DYNAMIC)
    elif kind in (SLOW, INTERMITTENT):
        assert 0 < there.sum() < 0.8 * len(there)
        assert np.array_equal(actual[there], read[there])
    else:
        assert (actual != read).mean() > 0.5
    sound = fly_by_sensors(12, {}, ENABLED, TUBE)
    assert place(flight, 12.0) == place(sound, 12.0)
