"""Telemetry of external sensors."""

import math

import numpy as np
import pytest
from adapter_harness import Bench

from lapwing.messages import (
    FluidPressure,
    GPSFix,
    GPSStatus,
    LaserScan,
    NavSatFix,
    NavSatStatus,
    OpticalFlow,
    PointCloud2,
    PointField,
    Range,
    TwistWithCovarianceStamped,
    header,
)
from lapwing.messages.topics import (
    AIRSPEED,
    AIRSPEED_RECEIVED,
    GPS,
    GPS_DETAILS,
    GPS_VELOCITY,
    LASER_SCAN,
    OPTICAL_FLOW,
    POINT_CLOUD,
    RANGEFINDER,
    SONAR,
)
from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.mavlink.telemetry.external_sensors import orientation

HEAD = header(0, "drone1")
SENSORS = ("imu", "magnetometer", "gps", "barometer", "sonar", "rangefinder", "optical_flow", "airspeed")
FITTED = [f"sensors.{name}.preset=ideal" for name in SENSORS]


def shown(*messages, more=FITTED, steps=120):
    """Return a station of a vehicle that publishes these sensor messages, (topic, message)."""
    bench = Bench(*more)
    bench.vehicle.more = list(messages)
    station = bench.station()
    bench.step(steps)
    return station


def rotate(q, v):
    """Return v rotated by the quaternion q: v + 2 w (u x v) + 2 u x (u x v)."""
    w, *u = q

    def cross(a, b):
        return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]

    once = cross(u, v)
    twice = cross(u, once)
    return [v[k] + 2.0 * w * once[k] + 2.0 * twice[k] for k in range(3)]


def test_directions_have_mavlink_numbers():
    names = {(0, 0): "NONE", (-45, 0): "YAW_45", (90, 0): "YAW_270", (180, 0): "YAW_180", (30, 90): "PITCH_90"}
    names |= {(0, -90): "PITCH_270"}
    for (azimuth, elevation), name in names.items():
        number = getattr(mavlink, f"MAV_SENSOR_ROTATION_{name}")
        assert orientation(azimuth, elevation) == (number, (0.0, 0.0, 0.0, 0.0))


@pytest.mark.parametrize(("azimuth", "elevation"), [(20.0, 0.0), (0.0, -45.0), (-100.0, 30.0)])
def test_other_direction_is_rotation_from_forward(azimuth, elevation):
    number, q = orientation(azimuth, elevation)
    assert number == mavlink.MAV_SENSOR_ROTATION_CUSTOM
    a, e = math.radians(azimuth), math.radians(elevation)
    flu = (math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e))
    assert rotate(q, [1.0, 0.0, 0.0]) == pytest.approx((flu[0], -flu[1], -flu[2]))


def test_sonar_and_rangefinder_are_two_distance_sensors():
    down = Range(HEAD, radiation_type=Range.ULTRASOUND, min_range=0.2, max_range=7.0, range=1.5, variance=1e-4)
    ahead = Range(HEAD, radiation_type=Range.INFRARED, min_range=0.05, max_range=40.0, range=math.inf)
    more = [*FITTED, "sensors.rangefinder.elevation_deg=0.0", "sensors.rangefinder.azimuth_deg=-90.0"]
    station = shown((SONAR, down), (RANGEFINDER, ahead), more=more)
    result = {m.id: m for m in station.all("DISTANCE_SENSOR")}
    assert (result[0].current_distance, result[0].orientation) == (150, mavlink.MAV_SENSOR_ROTATION_PITCH_270)
    assert (result[1].current_distance, result[1].orientation) == (4001, mavlink.MAV_SENSOR_ROTATION_YAW_90)
    assert (result[0].type, result[1].type) == (1, 0)


def test_flow_has_signs_of_mavlink():
    """Check the signs: forward motion makes the flow about y positive, motion to the right that about x negative."""
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


def test_airspeed_is_ground_speed_without_sensor():
    tail = shown((AIRSPEED, FluidPressure(HEAD, -5.0, 0.0))).last("VFR_HUD")
    ahead = shown((AIRSPEED, FluidPressure(HEAD, 0.5 * 1.225 * 8.0**2, 0.0))).last("VFR_HUD")
    assert (tail.airspeed, ahead.airspeed) == pytest.approx((0.0, 8.0))
    none = shown().last("VFR_HUD")
    assert none.airspeed == none.groundspeed


def test_offset_of_airspeed_sensor_is_subtracted():
    bench = Bench("sensors.airspeed={}")
    station = bench.station()
    bench.vehicle.more = [(AIRSPEED, FluidPressure(HEAD, 0.5 * 1.225 * 8.0**2 + 10.0, 0.0))]
    station.send("param_set", 1, 1, b"SENS_DPRES_OFF", 10.0, mavlink.MAV_PARAM_TYPE_REAL32)
    bench.step(100)
    assert station.last("PARAM_VALUE").param_value == 10.0
    assert station.last("VFR_HUD").airspeed == pytest.approx(8.0)


def test_airspeed_is_value_received_by_autopilot():
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


def test_status_bits_follow_fitted_sensors():
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
def test_status_shows_rejected_sources(source, bit):
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


def test_obstacles_are_clockwise_from_ahead():
    """Check a wall to the left (azimuth 90 degrees): sector 54 of 72, 270 degrees clockwise."""
    ranges = [math.inf] * 360
    ranges[180 + 90], ranges[180] = 3.0, -math.inf
    scan = LaserScan(HEAD, -math.pi, math.radians(179.0), math.radians(1.0), 0.0, 0.1, 0.15, 12.0, tuple(ranges), ())
    m = shown((LASER_SCAN, scan)).last("OBSTACLE_DISTANCE")
    assert (m.distances[54], m.distances[0], m.distances[18]) == (300, 15, 1201)
    assert (m.increment_f, m.max_distance, m.min_distance) == (5.0, 1200, 15)
    assert m.frame == mavlink.MAV_FRAME_BODY_FRD


def test_obstacles_of_point_cloud_exclude_ground():
    fields = tuple(PointField(name, 4 * k, PointField.FLOAT32, 1) for k, name in enumerate("xyz"))
    points = np.array([[4.0, 0.0, 0.1], [2.0, 0.0, -0.5], [math.nan] * 3], "<f4")
    cloud = PointCloud2(HEAD, 1, 3, fields, False, 12, 36, tuple(points.tobytes()), False)
    m = shown((POINT_CLOUD, cloud)).last("OBSTACLE_DISTANCE")
    assert (m.distances[0], m.distances[36]) == (400, 0xFFFF)


@pytest.mark.parametrize(
    ("status", "fix_type"),
    [
        (GPSStatus.STATUS_FIX, mavlink.GPS_FIX_TYPE_3D_FIX),
        (GPSStatus.STATUS_SBAS_FIX, mavlink.GPS_FIX_TYPE_DGPS),
        (GPSStatus.STATUS_RTK_FLOAT, mavlink.GPS_FIX_TYPE_RTK_FLOAT),
        (GPSStatus.STATUS_RTK_FIX, mavlink.GPS_FIX_TYPE_RTK_FIXED),
    ],
)
def test_gps_reports_fix_type_dilution_and_satellites(status, fix_type):
    details = GPSFix(
        HEAD, GPSStatus(HEAD, satellites_used=7, satellites_visible=9, status=status), hdop=0.92, vdop=1.37
    )
    station = shown(
        (GPS, NavSatFix(HEAD, NavSatStatus(NavSatStatus.STATUS_GBAS_FIX), 40.0, 14.0, 300.0)),
        (GPS_VELOCITY, TwistWithCovarianceStamped(HEAD)),
        (GPS_DETAILS, details),
    )
    m = station.last("GPS_RAW_INT")
    assert (m.fix_type, m.eph, m.epv, m.satellites_visible) == (fix_type, 92, 137, 9)


def test_gps_without_fix_reports_visible_satellites():
    station = shown(
        (GPS, NavSatFix(HEAD, NavSatStatus(NavSatStatus.STATUS_NO_FIX))),
        (GPS_VELOCITY, TwistWithCovarianceStamped(HEAD)),
        (GPS_DETAILS, GPSFix(HEAD, GPSStatus(HEAD, satellites_visible=3, status=GPSStatus.STATUS_NO_FIX))),
    )
    m = station.last("GPS_RAW_INT")
    assert (m.fix_type, m.satellites_visible) == (mavlink.GPS_FIX_TYPE_NO_FIX, 3)
