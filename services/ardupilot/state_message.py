"""State of the vehicle as a JSON message for ArduPilot.

ArduPilot reads the message without a JSON parser: no space may follow a colon, and a key must not be the beginning of
an earlier one. Position and velocity are north, east, down; body vectors are forward, right, down; the quaternion
rotates body to earth, scalar first. Sources: ArduPilot, libraries/SITL/examples/JSON/readme.md and SIM_JSON.cpp.
"""

from typing import Any, NamedTuple

import numpy as np

from lapwing.dynamics.lie.quaternion import NO_ROTATION, Quaternion
from lapwing.dynamics.vector import ZERO, Vec3
from lapwing.kernels import always_inline, math
from lapwing.services.ardupilot.decimal_text import LIMIT, write_number, write_text
from lapwing.services.common.mavlink import frames


def _text(text: str) -> np.ndarray:
    return np.frombuffer(text.encode(), np.uint8).copy()


_TIME, _GYRO, _FORCE = _text('\n{"timestamp":'), _text(',"imu":{"gyro":['), _text('],"accel_body":[')
_POSITION, _QUATERNION = _text(']},"position":['), _text('],"quaternion":[')
_VELOCITY, _END, _COMMA = _text('],"velocity":['), _text("}\n"), _text(",")
_RANGE, _AFTER_RANGE, _AIRSPEED = _text(',"rng_'), _text('":'), _text(',"airspeed":')
_BATTERY, _CURRENT, _CLOSE, _BRACE = _text(',"battery":{"voltage":'), _text(',"current":'), _text("]"), _text("}")
_swap_world, _swap_body = always_inline(frames.swap_world), always_inline(frames.swap_body)
_swap_attitude = always_inline(frames.swap_attitude)
_NANO, _TENTH_NANO, _MICRO = 10**9, 10**10, 10**6
INVALID = -1


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


@always_inline
def _fits(values: Any) -> bool:
    """Return True if all absolute values are below LIMIT."""
    result = True
    for value in values:
        result = result and math.fabs(value) < LIMIT
    return result


@always_inline
def _write_numbers(out: Any, at: int, values: Any) -> int:
    """Write numbers with nine decimals, separated by commas."""
    first = True
    for value in values:
        if not first:
            at = write_text(out, at, _COMMA)
        first = False
        at = write_number(out, at, value, 9, _NANO)
    return at


@always_inline
def write_state(out: Any, time: float, state: VehicleState, extras: Extras) -> int:
    """Write the message into `out`.

    Numbers have 9 decimals, the time 10, optional fields 6.

    Args:
        out: bytes, shape (2048,).
        time: [s] of the simulation.
        state: state of the vehicle.
        extras: optional fields.

    Returns:
        Length [bytes]; INVALID if a number of the state is not finite, or is 9e8 or more.
    """
    position, velocity = _swap_world(state.position_world), _swap_world(state.velocity_world)
    gyro, force = _swap_body(state.omega_body), _swap_body(state.specific_force_body)
    quaternion = _swap_attitude(state.attitude)
    if not _fits((time, *gyro, *force, *position, *quaternion, *velocity)):
        return INVALID
    at = write_number(out, write_text(out, 0, _TIME), time, 10, _TENTH_NANO)
    at = _write_numbers(out, write_text(out, at, _GYRO), gyro)
    at = _write_numbers(out, write_text(out, at, _FORCE), force)
    at = _write_numbers(out, write_text(out, at, _POSITION), position)
    at = _write_numbers(out, write_text(out, at, _QUATERNION), quaternion)
    at = write_text(out, _write_numbers(out, write_text(out, at, _VELOCITY), velocity), _CLOSE)
    return write_text(out, _write_optional(out, at, extras), _END)


@always_inline
def _write_optional(out: Any, at: int, extras: Extras) -> int:
    """Write the optional fields, each after a comma."""
    for k in range(len(extras.ranges)):
        if math.fabs(extras.ranges[k]) < LIMIT:
            at = write_number(out, write_text(out, at, _RANGE), k + 1.0, 0, 1)
            at = write_number(out, write_text(out, at, _AFTER_RANGE), extras.ranges[k], 6, _MICRO)
    if math.fabs(extras.airspeed) < LIMIT:
        at = write_number(out, write_text(out, at, _AIRSPEED), extras.airspeed, 6, _MICRO)
    if math.fabs(extras.voltage) < LIMIT and math.fabs(extras.current) < LIMIT:
        at = write_number(out, write_text(out, at, _BATTERY), extras.voltage, 6, _MICRO)
        at = write_number(out, write_text(out, at, _CURRENT), extras.current, 6, _MICRO)
        at = write_text(out, at, _BRACE)
    return at
