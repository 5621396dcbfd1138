"""Position, velocity and attitude."""

import math
from typing import Any

from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.common.mavlink.frames import compass, saturate
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
