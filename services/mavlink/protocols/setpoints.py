"""Setpoints of offboard flight, and sticks: streams of messages without acknowledgement; a rejection sends a text."""

from typing import Any

from lapwing.dynamics.vector import Vec3
from lapwing.kernels import math
from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.common.mavlink.frames import swap_attitude, swap_body, swap_world, swap_yaw
from lapwing.services.common.mavlink.geo_coordinates import (
    ABOVE_HOME,
    ABOVE_SEA,
    degrees,
    from_local,
    from_world,
    to_world,
)
from lapwing.services.mavlink.protocols import handles
from lapwing.services.mavlink.session import Session

_AHEAD = {mavlink.MAV_FRAME_BODY_OFFSET_NED, mavlink.MAV_FRAME_BODY_FRD}  # positions from the vehicle, along its axes
_FROM_HERE = _AHEAD | {mavlink.MAV_FRAME_LOCAL_OFFSET_NED}  # positions from the vehicle
_BODY = _AHEAD | {mavlink.MAV_FRAME_BODY_NED}  # velocities along the vehicle's axes
_LOCAL = _BODY | _FROM_HERE | {mavlink.MAV_FRAME_LOCAL_NED}
FORCE = mavlink.POSITION_TARGET_TYPEMASK_FORCE_SET
IGNORE_YAW = mavlink.POSITION_TARGET_TYPEMASK_YAW_IGNORE
IGNORE_YAW_RATE = mavlink.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE
THRUST_BODY = 1 << 5  # ATTITUDE_TARGET_TYPEMASK_THRUST_BODY_SET, which pymavlink lacks
CENTRE = 500.0  # centre of the throttle stick, whose range is 0 to 1000
_GUIDED = ("hold", "goto", "offboard")  # modes that ArduPilot's GUIDED covers


def apply_mask(mask: int, first_bit: int, x: float, y: float, z: float) -> Vec3:
    """Return three numbers in their NED or FRD axes, with NaN where the mask ignores them."""
    a, b, c = (math.nan if mask >> first_bit + k & 1 else value for k, value in enumerate((x, y, z)))
    return a, b, c


def rotate(v: Vec3, heading: float) -> Vec3:
    """Rotate forward, right, down to north, east, down; if one of a horizontal pair is NaN it counts as 0."""
    s, c = math.sin(heading), math.cos(heading)
    if math.isnan(v[0]) and math.isnan(v[1]):
        return v
    x, y = (0.0 if math.isnan(e) else e for e in v[:2])
    return c * x - s * y, s * x + c * y, v[2]


@handles("SET_POSITION_TARGET_LOCAL_NED")
def local_target(session: Session, m: Any) -> None:
    """Handle SET_POSITION_TARGET_LOCAL_NED: setpoints relative to the local origin or the vehicle."""
    estimate = session.vehicle.estimate
    if m.coordinate_frame not in _LOCAL or estimate is None:
        _reject(session, f"SET_POSITION_TARGET_LOCAL_NED: frame {m.coordinate_frame} unsupported")
        return
    position = apply_mask(m.type_mask, 0, m.x, m.y, m.z)
    velocity = apply_mask(m.type_mask, 3, m.vx, m.vy, m.vz)
    acceleration = apply_mask(m.type_mask, 6, m.afx, m.afy, m.afz)
    heading = estimate.angles[2]
    if m.coordinate_frame in _BODY:
        velocity, acceleration = rotate(velocity, heading), rotate(acceleration, heading)
    if m.coordinate_frame in _AHEAD:
        position = rotate(position, heading)
    if m.coordinate_frame in _FROM_HERE:
        n, e, d = estimate.position_ned
        position = position[0] + n, position[1] + e, position[2] + d
    yaw_reference = heading if session.vehicle.firmware.GUIDED and m.coordinate_frame in _BODY else 0.0
    position_world = from_local(session.vehicle.description.standing_height, position)
    _put(session, m, position_world, velocity, acceleration, yaw_reference)


@handles("SET_POSITION_TARGET_GLOBAL_INT")
def global_target(session: Session, m: Any) -> None:
    """Handle SET_POSITION_TARGET_GLOBAL_INT: setpoints with a geographic position."""
    estimate = session.vehicle.estimate
    if m.coordinate_frame not in ABOVE_SEA | ABOVE_HOME or estimate is None:
        _reject(session, f"SET_POSITION_TARGET_GLOBAL_INT: frame {m.coordinate_frame} unsupported")
        return
    latitude, longitude, altitude = apply_mask(m.type_mask, 0, degrees(m.lat_int), degrees(m.lon_int), m.alt)
    if math.isnan(latitude) != math.isnan(longitude):
        here = from_world(session.vehicle.datum, estimate.position_world)
        latitude, longitude = (h if math.isnan(v) else v for v, h in zip((latitude, longitude), here[:2], strict=True))
    try:
        position_world = to_world(session.vehicle.datum, m.coordinate_frame, latitude, longitude, altitude)
    except ValueError:
        _reject(session, "SET_POSITION_TARGET_GLOBAL_INT: invalid position")
        return
    velocity = apply_mask(m.type_mask, 3, m.vx, m.vy, m.vz)
    acceleration = apply_mask(m.type_mask, 6, m.afx, m.afy, m.afz)
    _put(session, m, position_world, velocity, acceleration)


def _unless(ignored: int, value: float) -> float:
    return math.nan if ignored else value


def _put(
    session: Session, m: Any, position_world: Vec3, velocity: Vec3, acceleration: Vec3, yaw_reference: float = 0.0
) -> None:
    """Send a setpoint; velocity and acceleration in NED, yaw relative to `yaw_reference` [rad]."""
    yaw = swap_yaw(yaw_reference + _unless(m.type_mask & IGNORE_YAW, m.yaw))
    rate = -_unless(m.type_mask & IGNORE_YAW_RATE, m.yaw_rate)
    values = (*position_world, *swap_world(velocity), *swap_world(acceleration), yaw, rate)
    if m.type_mask & FORCE:
        _reject(session, f"{m.get_type()}: forces unsupported")
    elif all(map(math.isnan, values)):
        _reject(session, f"{m.get_type()}: contains no setpoint")
    elif session.vehicle.firmware.GUIDED and all(map(math.isnan, (*values[3:9], rate))):
        if _follows_setpoint(session, m):  # ArduPilot flies to a position that is sent once
            _send(session, m, "goto", (*position_world, yaw))
    else:
        _send(session, m, "offboard_position", values)


@handles("SET_ATTITUDE_TARGET")
def attitude_target(session: Session, m: Any) -> None:
    """Handle SET_ATTITUDE_TARGET: attitude or body rates, and thrust as a fraction; for ArduPilot a climb rate."""
    ignored = m.type_mask & mavlink.ATTITUDE_TARGET_TYPEMASK_ATTITUDE_IGNORE
    norm = math.sqrt(sum(e * e for e in m.q))
    if not ignored and not 0.5 < norm < 2.0:  # NaN fails too
        _reject(session, "SET_ATTITUDE_TARGET: no attitude")
        return
    unit = (math.nan,) * 4 if ignored else swap_attitude(tuple(e / norm for e in m.q))  # type: ignore[arg-type]
    rates = apply_mask(m.type_mask, 0, m.body_roll_rate, m.body_pitch_rate, m.body_yaw_rate)
    if ignored and all(map(math.isnan, rates)):
        _reject(session, "SET_ATTITUDE_TARGET: contains no setpoint")
        return
    thrust, climb_rate = _unless(m.type_mask & mavlink.ATTITUDE_TARGET_TYPEMASK_THROTTLE_IGNORE, m.thrust), 0.0
    if m.type_mask & THRUST_BODY:
        _reject(session, "SET_ATTITUDE_TARGET: thrust_body unsupported")
        return
    if session.vehicle.firmware.GUIDED and not math.isnan(thrust):
        climb_rate = (2.0 * thrust - 1.0) * session.parameters.value("MPC_Z_VEL_MAX_UP")
        thrust = math.nan
    _send(session, m, "offboard_attitude", (*unit, *swap_body(rates), thrust, climb_rate))


@handles("MANUAL_CONTROL")
def manual_control(session: Session, m: Any) -> None:
    """Handle MANUAL_CONTROL: joystick axes -1000 to 1000 forward, right and yaw right, throttle 0 to 1000."""
    values = (_stick(m.x), -_stick(m.y), _stick(2.0 * (m.z - CENTRE)), -_stick(m.r))
    if session.trusted:
        session.sticks(values)


def _stick(value: float) -> float:
    """Return the position of a stick, -1 to 1; 0 for an absent one."""
    return value * 1e-3 if abs(value) <= 1000.0 else 0.0


def _send(session: Session, m: Any, kind: str, values: tuple[float, ...]) -> None:
    if any(map(math.isinf, values)):
        _reject(session, f"{m.get_type()}: not finite")
        return
    guided = session.vehicle.firmware.GUIDED
    if not session.trusted or (guided and not _follows_setpoint(session, m)):
        return
    if kind == "goto":
        session.command(kind, values)
    else:
        session.offboard(kind, values)
    if guided and kind != "goto" and session.vehicle.status.mode != "offboard":
        session.command("offboard")  # ArduPilot's GUIDED follows setpoints immediately


def _follows_setpoint(session: Session, m: Any) -> bool:
    """Return True if ArduPilot's GUIDED mode would follow a setpoint now."""
    status = session.vehicle.status
    if status.mode in _GUIDED and not status.landed:
        return True
    _reject(session, f"{m.get_type()}: only in GUIDED, flying")
    return False


def _reject(session: Session, reason: str) -> None:
    session.count("invalid setpoint")
    session.send_text(reason)
