"""Setpoints of the controllers."""

import math
from typing import Any

from lapwing.dynamics.vector import Vec3
from lapwing.messages.topics import ACTUATORS, SETPOINT
from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.common.mavlink.frames import from_euler, saturate, swap_attitude, swap_world, swap_yaw
from lapwing.services.common.mavlink.geo_coordinates import from_world, to_local
from lapwing.services.mavlink.telemetry.message_stream import stream
from lapwing.services.mavlink.telemetry.power import motor_fractions
from lapwing.services.mavlink.vehicle_cache import VehicleCache

_RATES_IGNORED = (
    mavlink.ATTITUDE_TARGET_TYPEMASK_BODY_ROLL_RATE_IGNORE
    | mavlink.ATTITUDE_TARGET_TYPEMASK_BODY_PITCH_RATE_IGNORE
    | mavlink.ATTITUDE_TARGET_TYPEMASK_BODY_YAW_RATE_IGNORE
)
_YAW_BIT = 10  # bit of the type mask, after 3 each of position, velocity, acceleration, and 1 of force


def _kinematics(setpoint: Any) -> tuple[int, Vec3, tuple[float, ...]]:
    """Return type mask, world position [m], and velocity, acceleration, yaw and yaw rate in NED."""
    position = tuple(setpoint.position)
    velocity, acceleration = swap_world(tuple(setpoint.velocity)), swap_world(tuple(setpoint.acceleration))
    turn = swap_yaw(setpoint.yaw), -setpoint.yaw_rate
    values = (position[1], position[0], position[2], *velocity, *acceleration)
    mask = sum(1 << k for k, value in enumerate(values) if not math.isfinite(value))
    mask |= sum(1 << _YAW_BIT + k for k, value in enumerate(turn) if not math.isfinite(value))
    return mask, position, (*velocity, *acceleration, *turn)


@stream("POSITION_TARGET_LOCAL_NED", 1.5, 10.0)
def local_target(v: VehicleCache) -> Any:
    """Return the setpoint of position, velocity and acceleration. Return None while the motors are off."""
    setpoint = v.get(SETPOINT)
    if setpoint is None or not v.status.armed:
        return None
    mask, position, rest = _kinematics(setpoint)
    return mavlink.MAVLink_position_target_local_ned_message(
        v.boot_ms, mavlink.MAV_FRAME_LOCAL_NED, mask, *to_local(v.description.standing_height, position), *rest
    )


@stream("POSITION_TARGET_GLOBAL_INT", 1.0, 10.0)
def global_target(v: VehicleCache) -> Any:
    """Return the setpoint with a geographic position. Return None without a position setpoint."""
    setpoint = v.get(SETPOINT)
    if setpoint is None or not v.status.armed or not all(map(math.isfinite, setpoint.position)):
        return None
    mask, position, rest = _kinematics(setpoint)
    latitude, longitude, altitude = from_world(v.datum, position)
    return mavlink.MAVLink_position_target_global_int_message(
        v.boot_ms,
        mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
        mask,
        saturate(latitude * 1e7, 32),
        saturate(longitude * 1e7, 32),
        altitude,
        *rest,
    )


@stream("ATTITUDE_TARGET", 2.0, 10.0)
def attitude_target(v: VehicleCache) -> Any:
    """Return the attitude setpoint and collective thrust as a fraction, without body rates."""
    actuators = v.get(ACTUATORS)
    if actuators is None or not v.status.armed:
        return None
    attitude = swap_attitude(from_euler(*actuators.attitude_reference))
    fractions = motor_fractions(v)
    thrust = sum(f * f for f in fractions) / max(1, len(fractions))  # static thrust grows with the squared voltage
    return mavlink.MAVLink_attitude_target_message(v.boot_ms, _RATES_IGNORED, list(attitude), 0.0, 0.0, 0.0, thrust)
