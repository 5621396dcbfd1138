"""State of the vehicle as a JSON message for ArduPilot.

ArduPilot reads the message without a JSON parser: no space may follow a colon, and a key must not be the beginning of
an earlier one. Position and velocity are north, east, down; body vectors are forward, right, down; the quaternion
rotates body to earth, scalar first. Sources: ArduPilot, libraries/SITL/examples/JSON/readme.md and SIM_JSON.cpp.
"""

from collections.abc import Sequence
from typing import NamedTuple

from lapwing.dynamics.lie.quaternion import NO_ROTATION, Quaternion
from lapwing.dynamics.vector import ZERO, Vec3
from lapwing.kernels import math
from lapwing.services.common.mavlink.frames import swap_attitude, swap_body, swap_world

RANGEFINDERS = 6  # rng_1 to rng_6
_FORMAT = (
    "\n"
    '{"timestamp":%.10f,"imu":{"gyro":[%.9g,%.9g,%.9g],"accel_body":[%.9g,%.9g,%.9g]},'
    '"position":[%.12g,%.12g,%.12g],"quaternion":[%.9g,%.9g,%.9g,%.9g],"velocity":[%.9g,%.9g,%.9g]'
)


class VehicleState(NamedTuple):
    """State in SI units, world ENU and body FLU."""

    position_world: Vec3 = ZERO  # [m] from ArduPilot's home
    velocity_world: Vec3 = ZERO  # [m/s]
    attitude: Quaternion = NO_ROTATION  # body to world
    omega_body: Vec3 = ZERO  # [rad/s]
    specific_force_body: Vec3 = ZERO  # [m/s^2], +g along z at rest


class Extras(NamedTuple):
    """Optional fields; None or empty: left out."""

    ranges: Sequence[float] = ()  # [m] of the rangefinders, at most 6; infinite: nothing in range
    airspeed: float | None = None  # [m/s]
    voltage: float | None = None  # [V] of the battery
    current: float | None = None  # [A] drawn


NO_EXTRAS = Extras()


def encode(time: float, state: VehicleState, extras: Extras = NO_EXTRAS) -> bytes:
    """Return the message.

    Args:
        time: [s] of the simulation.
        state: state of the vehicle.
        extras: optional fields.

    Raises:
        ValueError: a required number is not finite.
    """
    position, velocity = swap_world(state.position_world), swap_world(state.velocity_world)
    gyro, force = swap_body(state.omega_body), swap_body(state.specific_force_body)
    quaternion = swap_attitude(state.attitude)
    values = (time, *gyro, *force, *position, *quaternion, *velocity)
    text = _FORMAT % values
    if "nan" in text or "inf" in text:  # as written by the format; no key contains them
        raise ValueError("the state of the vehicle is not finite")
    return f"{text}{_optional(extras)}}}\n".encode()


def _optional(extras: Extras) -> str:
    """Return the optional fields, each after a comma."""
    text = "".join(
        f',"rng_{k}":{distance:.6g}'
        for k, distance in enumerate(extras.ranges[:RANGEFINDERS], start=1)
        if math.isfinite(distance)
    )
    if extras.airspeed is not None and math.isfinite(extras.airspeed):
        text += f',"airspeed":{extras.airspeed:.6g}'
    if extras.voltage is not None and extras.current is not None and math.isfinite(extras.voltage):
        text += f',"battery":{{"voltage":{extras.voltage:.6g},"current":{extras.current:.6g}}}'
    return text
