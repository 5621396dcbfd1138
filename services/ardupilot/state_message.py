"""State of the vehicle as a JSON message for ArduPilot, written by compiled code.

ArduPilot reads the message without a JSON parser: no space may follow a colon, and a key must not be the beginning of
an earlier one. Position and velocity are north, east, down; body vectors are forward, right, down; the quaternion
rotates body to earth, scalar first. Sources: ArduPilot, libraries/SITL/examples/JSON/readme.md and SIM_JSON.cpp.
"""

from typing import Any, NamedTuple

import numpy as np

from lapwing.dynamics.lie.quaternion import NO_ROTATION, Quaternion
from lapwing.dynamics.vector import ZERO, Vec3
from lapwing.kernels import always_inline, math, noinline
from lapwing.services.common.mavlink import frames

LIMIT = 9e8  # numbers below it have up to 10 decimals in an integer of 64 bits
INVALID = -1
_ZERO, _MINUS, _POINT = b"0-."
_SCALES = tuple(10**k for k in range(11))


def _text(text: str) -> np.ndarray:
    return np.frombuffer(text.encode(), np.uint8).copy()


_TIME, _GYRO, _FORCE = _text('\n{"timestamp":'), _text(',"imu":{"gyro":['), _text('],"accel_body":[')
_POSITION, _QUATERNION = _text(']},"position":['), _text('],"quaternion":[')
_VELOCITY, _END, _COMMA = _text('],"velocity":['), _text("}\n"), _text(",")
_RANGE, _AFTER_RANGE, _AIRSPEED = _text(',"rng_'), _text('":'), _text(',"airspeed":')
_BATTERY, _CURRENT, _CLOSE, _BRACE = _text(',"battery":{"voltage":'), _text(',"current":'), _text("]"), _text("}")
_swap_world, _swap_body = always_inline(frames.swap_world), always_inline(frames.swap_body)
_swap_attitude = always_inline(frames.swap_attitude)


class VehicleState(NamedTuple):
    """State in SI units, world ENU and body FLU."""

    position_world: Vec3 = ZERO  # [m] from ArduPilot's home
    velocity_world: Vec3 = ZERO  # [m/s]
    attitude: Quaternion = NO_ROTATION  # body to world
    omega_body: Vec3 = ZERO  # [rad/s]
    specific_force_body: Vec3 = ZERO  # [m/s^2], +g along z at rest


class Extras(NamedTuple):
    """Optional fields; those that are not finite are omitted."""

    ranges: tuple[float, ...] = (math.nan,)  # [m] of the rangefinders, at most 6
    airspeed: float = math.nan  # [m/s]
    voltage: float = math.nan  # [V] of the battery
    current: float = math.nan  # [A] drawn


@noinline
def write_number(out: Any, at: int, value: float, decimals: int) -> int:
    """Write a number, rounded to `decimals` decimals, without zeros at its end; its absolute value is below LIMIT.

    Args:
        out: buffer of bytes.
        at: index of the first byte.
        value: number to write.
        decimals: at most 10.

    Returns:
        The index after the number.
    """
    scale = _SCALES[decimals]
    n = int(math.fabs(value) * scale + 0.5)
    if value < 0.0 and n > 0:
        out[at] = _MINUS
        at += 1
    whole, rest = n // scale, n % scale
    digits, power = 1, 10
    while whole >= power:
        digits, power = digits + 1, power * 10
    for k in range(digits):
        out[at + digits - 1 - k] = _ZERO + whole % 10
        whole //= 10
    at += digits
    if rest == 0:
        return at
    out[at] = _POINT
    at += 1 + decimals
    for k in range(decimals):
        out[at - 1 - k] = _ZERO + rest % 10
        rest //= 10
    while out[at - 1] == _ZERO:
        at -= 1
    return at


@always_inline
def _write_text(out: Any, at: int, text: Any) -> int:
    for k in range(len(text)):
        out[at + k] = text[k]
    return at + len(text)


@always_inline
def _write(out: Any, at: int, text: Any, values: Any, decimals: int) -> int:
    """Write a text, and after it numbers separated by commas."""
    at, first = _write_text(out, at, text), True
    for value in values:
        if not first:
            at = _write_text(out, at, _COMMA)
        first = False
        at = write_number(out, at, value, decimals)
    return at


@always_inline
def _is_valid(values: Any) -> bool:
    """Return True if all absolute values are below LIMIT."""
    result = True
    for value in values:
        result = result and math.fabs(value) < LIMIT
    return result


@always_inline
def write_state(out: Any, time: float, state: VehicleState, extras: Extras) -> int:
    """Write the message into `out`. Numbers have 9 decimals, the time 10, optional fields 6.

    Args:
        out: bytes, at least 2048.
        time: [s] of the simulation.
        state: state of the vehicle.
        extras: optional fields.

    Returns:
        Length [bytes]; INVALID if a number of the state is not finite, or is 9e8 or more.
    """
    position, velocity = _swap_world(state.position_world), _swap_world(state.velocity_world)
    gyro, force = _swap_body(state.omega_body), _swap_body(state.specific_force_body)
    quaternion = _swap_attitude(state.attitude)
    if not _is_valid((time, *gyro, *force, *position, *quaternion, *velocity)):
        return INVALID
    at = _write(out, 0, _TIME, (time,), 10)
    at = _write(out, at, _GYRO, gyro, 9)
    at = _write(out, at, _FORCE, force, 9)
    at = _write(out, at, _POSITION, position, 9)
    at = _write(out, at, _QUATERNION, quaternion, 9)
    at = _write(out, at, _VELOCITY, velocity, 9)
    at = _write_text(out, at, _CLOSE)
    for k in range(len(extras.ranges)):
        if math.fabs(extras.ranges[k]) < LIMIT:
            at = _write(out, at, _RANGE, (k + 1.0,), 0)
            at = _write(out, at, _AFTER_RANGE, (extras.ranges[k],), 6)
    if math.fabs(extras.airspeed) < LIMIT:
        at = _write(out, at, _AIRSPEED, (extras.airspeed,), 6)
    if _is_valid((extras.voltage, extras.current)):
        at = _write(out, at, _BATTERY, (extras.voltage,), 6)
        at = _write(out, at, _CURRENT, (extras.current,), 6)
        at = _write_text(out, at, _BRACE)
    return _write_text(out, at, _END)
