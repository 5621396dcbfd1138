"""Conversion of world ENU and body FLU to and from MAVLink's NED and FRD, and of floats to integer fields.

NED is (north, east, down): C = [[0, 1, 0], [1, 0, 0], [0, 0, -1]] of ENU; FRD is D = diag(1, -1, -1) of FLU. Both are
half turns, so each function is its own inverse.
"""

from lapwing.dynamics.vector import Vec3
from lapwing.kernels import math

Quaternion = tuple[float, float, float, float]  # w, x, y, z
_S = math.sqrt(0.5)


def swap_world(v: Vec3) -> Vec3:
    """Convert ENU to NED, or NED to ENU."""
    return v[1], v[0], -v[2]


def swap_body(v: Vec3) -> Vec3:
    """Convert FLU to FRD, or FRD to FLU."""
    return v[0], -v[1], -v[2]


def swap_yaw(yaw: float) -> float:
    """Convert yaw from east, counterclockwise [rad], to heading from north, clockwise, and vice versa; in (-pi, pi]."""
    return wrap(0.5 * math.pi - yaw)


def wrap(angle: float) -> float:
    """Return the angle [rad] in (-pi, pi]; NaN for NaN."""
    if not math.isfinite(angle):
        return math.nan
    return math.pi - (math.pi - angle) % (2.0 * math.pi)


def swap_attitude(q: Quaternion) -> Quaternion:
    """Convert the attitude of FLU in ENU to that of FRD in NED, or back; the scalar part is not negative."""
    w, x, y, z = q
    # (0, s, s, 0) * q * (0, 1, 0, 0), s = sqrt(1/2): C from the left, D from the right
    a, b, c, d = -_S * (x + y), _S * (w + z), _S * (w - z), _S * (y - x)
    return (b, -a, -d, c) if b > 0.0 else (-b, a, d, -c)


def from_euler(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Return the quaternion of roll, pitch, yaw [rad]."""
    cr, sr = math.cos(0.5 * roll), math.sin(0.5 * roll)
    cp, sp = math.cos(0.5 * pitch), math.sin(0.5 * pitch)
    cy, sy = math.cos(0.5 * yaw), math.sin(0.5 * yaw)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def compass(angle: float) -> int:
    """Convert an angle from north, clockwise [rad], to 0.01 deg, 0 to 35999; 65535 for NaN."""
    return round(math.degrees(angle) * 100.0) % 36000 if math.isfinite(angle) else 0xFFFF


def saturate(value: float, bits: int, unsigned: bool = False, unknown: int | None = None) -> int:
    """Return the nearest integer that fits an integer field.

    Args:
        value: value in the field's unit.
        bits: width of the field.
        unsigned: True for an unsigned field.
        unknown: result for a value that is not finite; None: the maximum.
    """
    minimum, maximum = (0, (1 << bits) - 1) if unsigned else (-(1 << bits - 1), (1 << bits - 1) - 1)
    if not math.isfinite(value):
        return maximum if unknown is None else unknown
    whole = round(value)
    return whole if minimum <= whole <= maximum else minimum if whole < minimum else maximum
