"""Position, velocity and attitude: estimated, with covariance, and true."""

import math
from typing import Any

from lapwing.dynamics.constants import STANDARD_GRAVITY
from lapwing.messages.topics import ESTIMATE, TRUTH
from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.common.mavlink.frames import compass, saturate, swap_world
from lapwing.services.mavlink.telemetry.external_sensors import indicated_airspeed
from lapwing.services.mavlink.telemetry.message_stream import stream
from lapwing.services.mavlink.telemetry.power import motor_fractions
from lapwing.services.mavlink.vehicle_cache import VehicleCache

_NO_OFFSET = (0.0, 0.0, 0.0, 0.0)  # rotation of the displayed axes from those of the vehicle


@stream("ATTITUDE", 50.0)
def attitude(v: VehicleCache) -> Any:
    """Return Euler angles and body rates."""
    if (m := v.estimate) is None:
        return None
    return mavlink.MAVLink_attitude_message, (v.boot_ms, *m.angles, *m.omega_frd)


@stream("ATTITUDE_QUATERNION", 50.0)
def attitude_quaternion(v: VehicleCache) -> Any:
    """Return the attitude as a quaternion, and body rates."""
    if (m := v.estimate) is None:
        return None
    return mavlink.MAVLink_attitude_quaternion_message, (v.boot_ms, *m.attitude, *m.omega_frd, _NO_OFFSET)


@stream("LOCAL_POSITION_NED", 50.0)
def local_position(v: VehicleCache) -> Any:
    """Return position and velocity in NED from the local origin."""
    if (m := v.estimate) is None:
        return None
    return mavlink.MAVLink_local_position_ned_message, (v.boot_ms, *m.position_ned, *m.velocity_ned)


@stream("GLOBAL_POSITION_INT", 50.0)
def global_position(v: VehicleCache) -> Any:
    """Return the geographic position."""
    if (m := v.estimate) is None:
        return None
    latitude, longitude, altitude = m.geodetic
    return mavlink.MAVLink_global_position_int_message, (
        v.boot_ms,
        saturate(latitude * 1e7, 32),
        saturate(longitude * 1e7, 32),
        saturate(altitude * 1e3, 32),
        saturate((m.position_world[2] - v.home_world[2]) * 1e3, 32),
        *[saturate(u * 1e2, 16) for u in m.velocity_ned],
        compass(m.angles[2]),
    )


@stream("VFR_HUD", 4.0)
def hud(v: VehicleCache) -> Any:
    """Return the values of a head-up display."""
    if (m := v.estimate) is None:
        return None
    north, east, down = m.velocity_ned
    ground_speed = math.hypot(north, east)
    fractions = motor_fractions(v)
    throttle = round(100.0 * sum(fractions) / max(1, len(fractions)))
    airspeed = indicated_airspeed(v)
    return mavlink.MAVLink_vfr_hud_message(
        ground_speed if airspeed is None else airspeed,
        ground_speed,
        compass(m.angles[2]) // 100,
        throttle,
        m.geodetic[2],
        -down,
    )


@stream("ALTITUDE", 1.0)
def altitude(v: VehicleCache) -> Any:
    """Return the altitudes above all references."""
    if (m := v.estimate) is None:
        return None
    above_sea, local, above_home = m.geodetic[2], -m.position_ned[2], m.position_world[2] - v.home_world[2]
    return mavlink.MAVLink_altitude_message(v.boot_us, above_sea, above_sea, local, above_home, math.nan, math.nan)


_DIAGONAL = (0, 6, 11, 15, 18, 20)  # indices in the upper triangle of a 6 x 6 matrix, row by row
_GOOD, _BAD = 100, -1  # quality [%], -1: failed


def _triangle(*variances: float) -> list[float]:
    """Return the upper triangle of a covariance with known first diagonal entries."""
    covariance = [math.nan] * 21
    for index, variance in zip(_DIAGONAL, variances, strict=False):
        covariance[index] = variance
    return covariance


@stream("ODOMETRY", 0.0, 30.0)
def odometry(v: VehicleCache) -> Any:
    """Return the pose of FRD in NED and the velocity in NED, as in PX4."""
    m, e = v.estimate, v.get(ESTIMATE)
    if m is None:
        return None
    p, u, r = e.position_std, e.velocity_std, e.attitude_std
    return mavlink.MAVLink_odometry_message(
        m.time_ns // 1000,
        mavlink.MAV_FRAME_LOCAL_NED,
        mavlink.MAV_FRAME_LOCAL_NED,
        *m.position_ned,
        list(m.attitude),
        *m.velocity_ned,
        *m.omega_frd,
        _triangle(p.y**2, p.x**2, p.z**2, r.x**2, r.y**2, r.z**2),
        _triangle(u.y**2, u.x**2, u.z**2),
        0,
        mavlink.MAV_ESTIMATOR_TYPE_AUTOPILOT,
        _BAD if e.health_flags else _GOOD,
    )


MILLI_G = 1e-3 * STANDARD_GRAVITY  # [m/s^2]


@stream("HIL_STATE_QUATERNION", 15.0)
def true_state(v: VehicleCache) -> Any:
    """Return the true state; the acceleration is dv/dt in body axes."""
    m, truth = v.truth, v.get(TRUTH)
    if m is None:
        return None
    latitude, longitude, altitude = m.geodetic
    air_speed = saturate(100.0 * math.dist(m.velocity_ned, swap_world(tuple(truth.wind))), 16, unsigned=True)
    acceleration = _to_body(m.attitude, swap_world(tuple(truth.acceleration)))
    return mavlink.MAVLink_hil_state_quaternion_message, (
        v.boot_us,
        list(m.attitude),
        *m.omega_frd,
        saturate(latitude * 1e7, 32),
        saturate(longitude * 1e7, 32),
        saturate(altitude * 1e3, 32),
        *[saturate(u * 1e2, 16) for u in m.velocity_ned],
        air_speed,
        air_speed,
        *[saturate(a / MILLI_G, 16) for a in acceleration],
    )


@stream("WIND_COV", 0.5, 1.0)
def wind(v: VehicleCache) -> Any:
    """Return the velocity of the air at the vehicle, and the altitude above sea level."""
    m, truth = v.truth, v.get(TRUTH)
    if m is None:
        return None
    return mavlink.MAVLink_wind_cov_message(
        v.boot_us, *swap_world(tuple(truth.wind)), 0.0, 0.0, m.geodetic[2], 0.0, 0.0
    )


def _to_body(q: tuple[float, float, float, float], a: tuple[float, float, float]) -> tuple[float, float, float]:
    """Rotate a world vector into body axes."""
    w, x, y, z = q
    # v' = v - 2 u x (w v - u x v) with u the vector part: the inverse rotation
    c = (y * a[2] - z * a[1], z * a[0] - x * a[2], x * a[1] - y * a[0])
    d = (w * a[0] - c[0], w * a[1] - c[1], w * a[2] - c[2])
    return (a[0] - 2.0 * (y * d[2] - z * d[1]), a[1] - 2.0 * (z * d[0] - x * d[2]), a[2] - 2.0 * (x * d[1] - y * d[0]))
