"""Setpoints of offboard flight, and sticks: streams of messages that nobody acknowledges."""

import math
from typing import Any

from dynamics.vector import Vec3
from services.mavlink.coordinates import degrees, to_world
from services.mavlink.dialect import mavlink
from services.mavlink.frames import swap_attitude, swap_body, swap_world, swap_yaw
from services.mavlink.protocols.handler import handles
from services.mavlink.session import Session

NOT_GIVEN: Vec3 = (math.nan, math.nan, math.nan)
_AHEAD = {mavlink.MAV_FRAME_BODY_OFFSET_NED, mavlink.MAV_FRAME_BODY_FRD}  # positions from the vehicle, along its axes
_FROM_HERE = _AHEAD | {mavlink.MAV_FRAME_LOCAL_OFFSET_NED}  # positions from the vehicle
_BODY = _AHEAD | {mavlink.MAV_FRAME_BODY_NED}  # velocities along the vehicle's axes
_LOCAL = _BODY | _FROM_HERE | {mavlink.MAV_FRAME_LOCAL_NED}
FORCE = mavlink.POSITION_TARGET_TYPEMASK_FORCE_SET
IGNORE_YAW = mavlink.POSITION_TARGET_TYPEMASK_YAW_IGNORE
IGNORE_YAW_RATE = mavlink.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE
CENTRE = 500.0  # of the throttle stick, which is the only one from 0 to 1000


def masked(mask: int, first_bit: int, x: float, y: float, z: float) -> Vec3:
    """Three numbers, NaN where the mask says to ignore them; from NED or FRD axes still."""
    a, b, c = (math.nan if mask >> first_bit + k & 1 else value for k, value in enumerate((x, y, z)))
    return a, b, c


def rotated(v: Vec3, heading: float) -> Vec3:
    """A vector of forward, right, down as north, east, down."""
    s, c = math.sin(heading), math.cos(heading)
    return c * v[0] - s * v[1], s * v[0] + c * v[1], v[2]


@handles("SET_POSITION_TARGET_LOCAL_NED")
def local_target(session: Session, m: Any) -> None:
    """Position, velocity, acceleration from home, or from the vehicle along the world's or its own axes."""
    estimate = session.vehicle.estimate
    if m.coordinate_frame not in _LOCAL or m.type_mask & FORCE or estimate is None:
        session.count("senseless setpoint")
        return
    position = masked(m.type_mask, 0, m.x, m.y, m.z)
    velocity = masked(m.type_mask, 3, m.vx, m.vy, m.vz)
    acceleration = masked(m.type_mask, 6, m.afx, m.afy, m.afz)
    heading = estimate.angles[2]
    if m.coordinate_frame in _BODY:
        velocity, acceleration = rotated(velocity, heading), rotated(acceleration, heading)
    if m.coordinate_frame in _AHEAD:
        position = rotated(position, heading)
    if m.coordinate_frame in _FROM_HERE:
        n, e, d = estimate.position_ned
        position = position[0] + n, position[1] + e, position[2] + d
    _put(session, m, swap_world(position), velocity, acceleration)


@handles("SET_POSITION_TARGET_GLOBAL_INT")
def global_target(session: Session, m: Any) -> None:
    """The same with the position on the Earth."""
    latitude, longitude, altitude = masked(m.type_mask, 0, degrees(m.lat_int), degrees(m.lon_int), m.alt)
    try:
        position_world = to_world(session.vehicle.datum, m.coordinate_frame, latitude, longitude, altitude)
    except ValueError:
        session.count("senseless setpoint")
        return
    velocity = masked(m.type_mask, 3, m.vx, m.vy, m.vz)
    acceleration = masked(m.type_mask, 6, m.afx, m.afy, m.afz)
    _put(session, m, position_world, velocity, acceleration)


def _unless(ignored: int, value: float) -> float:
    return math.nan if ignored else value


def _put(session: Session, m: Any, position_world: Vec3, velocity: Vec3, acceleration: Vec3) -> None:
    yaw, rate = swap_yaw(_unless(m.type_mask & IGNORE_YAW, m.yaw)), -_unless(m.type_mask & IGNORE_YAW_RATE, m.yaw_rate)
    values = (*position_world, *swap_world(velocity), *swap_world(acceleration), yaw, rate)
    _send(session, "offboard_position", values)


@handles("SET_ATTITUDE_TARGET")
def attitude_target(session: Session, m: Any) -> None:
    """Attitude or body rates, and collective thrust as a fraction of its maximum."""
    ignored = m.type_mask & mavlink.ATTITUDE_TARGET_TYPEMASK_ATTITUDE_IGNORE
    norm = math.sqrt(sum(e * e for e in m.q))
    if not ignored and not 0.5 < norm < 2.0:  # NaN fails too
        session.count("senseless setpoint")
        return
    unit = (math.nan,) * 4 if ignored else swap_attitude(tuple(e / norm for e in m.q))  # type: ignore[arg-type]
    rates = masked(m.type_mask, 0, m.body_roll_rate, m.body_pitch_rate, m.body_yaw_rate)
    thrust = _unless(m.type_mask & mavlink.ATTITUDE_TARGET_TYPEMASK_THROTTLE_IGNORE, m.thrust)
    _send(session, "offboard_attitude", (*unit, *swap_body(rates), thrust))


@handles("MANUAL_CONTROL")
def manual_control(session: Session, m: Any) -> None:
    """Sticks of a joystick, -1000 to 1000: forward, right, throttle from 0, turn to the right."""
    values = (_stick(m.x), -_stick(m.y), _stick(2.0 * (m.z - CENTRE)), -_stick(m.r))
    _send(session, "manual", values)


def _stick(value: float) -> float:
    """A stick's way, -1 to 1; one that is not there is in the middle."""
    return value * 1e-3 if abs(value) <= 1000.0 else 0.0


def _send(session: Session, kind: str, values: tuple[float, ...]) -> None:
    if any(map(math.isinf, values)):
        session.count("senseless setpoint")
    elif session.trusted:
        session.command(kind, values)
