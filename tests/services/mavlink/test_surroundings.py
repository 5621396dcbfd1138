"""Telemetry of the sensors that look outside."""

import math

import pytest
from adapter_harness import Bench

from lapwing.messages import FluidPressure, NavSatFix, NavSatStatus, OpticalFlow, Range, header
from lapwing.messages.topics import AIRSPEED, AIRSPEED_RECEIVED, GPS, OPTICAL_FLOW, RANGEFINDER, SONAR
from lapwing.services.mavlink.dialect import mavlink
from lapwing.services.mavlink.telemetry.external_sensors import orientation

HEAD = header(0, "drone1")
SENSORS = ("imu", "magnetometer", "gps", "barometer", "sonar", "rangefinder", "optical_flow", "airspeed")
FITTED = [f"sensors.{name}.preset=ideal" for name in SENSORS]


def shown(*messages, more=FITTED, steps=120):
    """A station that is shown messages of sensors, (topic, message)."""
    bench = Bench(*more)
    bench.vehicle.more = list(messages)
    station = bench.station()
    bench.step(steps)
    return station


def turned(q, v):
    """v turned by the quaternion q: v + 2 w (u x v) + 2 u x (u x v)."""
    w, *u = q

    def cross(a, b):
        return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]

    once = cross(u, v)
    twice = cross(u, once)
    return [v[k] + 2.0 * w * once[k] + 2.0 * twice[k] for k in range(3)]


def test_directions_have_the_numbers_of_mavlink():
    names = {(0, 0): "NONE", (-45, 0): "YAW_45", (90, 0): "YAW_270", (180, 0): "YAW_180", (30, 90): "PITCH_90"}
    names |= {(0, -90): "PITCH_270"}
    for (azimuth, elevation), name in names.items():
        number = getattr(mavlink, f"MAV_SENSOR_ROTATION_{name}")
        assert orientation(azimuth, elevation) == (number, (0.0, 0.0, 0.0, 0.0))


@pytest.mark.parametrize(("azimuth", "elevation"), [(20.0, 0.0), (0.0, -45.0), (-100.0, 30.0)])
def test_any_other_direction_is_a_turn_from_ahead(azimuth, elevation):
    number, q = orientation(azimuth, elevation)
    assert number == mavlink.MAV_SENSOR_ROTATION_CUSTOM
    a, e = math.radians(azimuth), math.radians(elevation)
    flu = (math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e))
    assert turned(q, [1.0, 0.0, 0.0]) == pytest.approx((flu[0], -flu[1], -flu[2]))


def test_sonar_and_rangefinder_are_two_distance_sensors():
    down = Range(HEAD, radiation_type=Range.ULTRASOUND, min_range=0.2, max_range=7.0, range=1.5, variance=1e-4)
    ahead = Range(HEAD, radiation_type=Range.INFRARED, min_range=0.05, max_range=40.0, range=math.inf)
    more = [*FITTED, "sensors.rangefinder.elevation_deg=0.0", "sensors.rangefinder.azimuth_deg=-90.0"]
    station = shown((SONAR, down), (RANGEFINDER, ahead), more=more)
    found = {m.id: m for m in station.all("DISTANCE_SENSOR")}
    assert (found[0].current_distance, found[0].orientation) == (150, mavlink.MAV_SENSOR_ROTATION_PITCH_270)
    assert (found[1].current_distance, found[1].orientation) == (4001, mavlink.MAV_SENSOR_ROTATION_YAW_90)
    assert (found[0].type, found[1].type) == (1, 0)


def test_flow_has_the_signs_of_mavlink():
    """Ahead makes the flow about y positive, to the right that about x negative; a right-handed turn is positive."""
    v, d = (2.0, -3.0), 4.0  # [m/s] ahead, to the right (FLU), [m]
    flow = OpticalFlow(HEAD, (v[1] / d, -v[0] / d), (0.1, 0.2), d, 1e-4)
    station = shown((OPTICAL_FLOW, flow))
    m = station.last("OPTICAL_FLOW_RAD")
    seconds = 1e-6 * m.integration_time_us
    assert seconds == pytest.approx(0.02)
    assert (m.integrated_x / seconds, m.integrated_y / seconds) == pytest.approx((-0.75, 0.5), rel=1e-6)
    assert (m.integrated_xgyro / seconds, m.integrated_ygyro / seconds) == pytest.approx((0.1, -0.2), rel=1e-6)
    assert (m.quality, m.distance) == (255, 4.0)
    blind = shown((OPTICAL_FLOW, OpticalFlow(HEAD, (math.nan, math.nan), (0.0, 0.0), math.inf, 0.0)))
    m = blind.last("OPTICAL_FLOW_RAD")
    assert (m.quality, m.distance) == (0, -1.0)


def test_airspeed_is_that_of_the_tube_and_over_the_ground_without_one():
    tail = shown((AIRSPEED, FluidPressure(HEAD, -5.0, 0.0))).last("VFR_HUD")
    ahead = shown((AIRSPEED, FluidPressure(HEAD, 0.5 * 1.225 * 8.0**2, 0.0))).last("VFR_HUD")
    assert (tail.airspeed, ahead.airspeed) == pytest.approx((0.0, 8.0))
    none = shown().last("VFR_HUD")
    assert none.airspeed == none.groundspeed


def test_airspeed_is_what_the_autopilot_gets_of_it():
    read = (AIRSPEED, FluidPressure(HEAD, 0.5 * 1.225 * 8.0**2, 0.0))
    half = shown(read, (AIRSPEED_RECEIVED, FluidPressure(HEAD, 0.5 * 1.225 * 4.0**2, 0.0))).last("VFR_HUD")
    assert half.airspeed == pytest.approx(4.0)
    lost = shown(read, (AIRSPEED_RECEIVED, FluidPressure(HEAD, math.nan, 0.0)))
    assert lost.last("VFR_HUD").airspeed == lost.last("VFR_HUD").groundspeed
    assert not lost.last("SYS_STATUS").onboard_control_sensors_health & BITS["airspeed"]


BITS = {
    "optical_flow": mavlink.MAV_SYS_STATUS_SENSOR_OPTICAL_FLOW,
    "airspeed": mavlink.MAV_SYS_STATUS_SENSOR_DIFFERENTIAL_PRESSURE,
    "rangefinder": mavlink.MAV_SYS_STATUS_SENSOR_LASER_POSITION,
}


def test_the_status_has_their_bits_where_they_are_fitted():
    bare = shown(more=()).last("SYS_STATUS")
    assert not bare.onboard_control_sensors_present & sum(BITS.values())
    silent = shown().last("SYS_STATUS")
    assert silent.onboard_control_sensors_present & sum(BITS.values()) == sum(BITS.values())
    assert not silent.onboard_control_sensors_health & sum(BITS.values())
    station = shown(
        (AIRSPEED, FluidPressure(HEAD, 1.0, 0.0)),
        (RANGEFINDER, Range(HEAD, range=1.0, max_range=2.0)),
        (OPTICAL_FLOW, OpticalFlow(HEAD, (0.0, 0.0), (0.0, 0.0), 1.0, 0.0)),
    )
    assert station.last("SYS_STATUS").onboard_control_sensors_health & sum(BITS.values()) == sum(BITS.values())


@pytest.mark.parametrize(
    ("source", "bit"),
    [
        ("gps", mavlink.MAV_SYS_STATUS_SENSOR_GPS),
        ("sonar", BITS["rangefinder"]),
        ("optical_flow", BITS["optical_flow"]),
    ],
)
def test_the_status_shows_what_the_estimator_refuses(source, bit):
    bench = Bench(*FITTED)
    bench.vehicle.more = [
        (GPS, NavSatFix(HEAD, NavSatStatus(NavSatStatus.STATUS_FIX))),
        (SONAR, Range(HEAD, range=1.0, max_range=2.0)),
        (OPTICAL_FLOW, OpticalFlow(HEAD, (0.0, 0.0), (0.0, 0.0), 1.0, 0.0)),
    ]
    station = bench.station()
    bench.step(120)
    assert station.last("SYS_STATUS").onboard_control_sensors_health & bit
    bench.vehicle.rejected = (source,)
    bench.step(120)
    assert not station.last("SYS_STATUS").onboard_control_sensors_health & bit
