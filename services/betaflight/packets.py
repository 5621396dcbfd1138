"""UDP packets of Betaflight SITL (little-endian), with its units and frames."""

import math
import struct
from typing import NamedTuple

from lapwing.dynamics.lie.quaternion import Quaternion
from lapwing.dynamics.vector import Vec3
from lapwing.services.common.firmware.firmware_config import FirmwareConfig

STATE, RC, MOTORS = struct.Struct("<18d"), struct.Struct("<d16H"), struct.Struct("<4f")
RC_LOW, RC_MIDDLE, RC_HIGH = 1000, 1500, 2000  # [us]


class Ports(NamedTuple):
    """Ports of one firmware; it opens all but the first, which is the simulator's."""

    motors: int = 9002
    state: int = 9003
    rc: int = 9004
    msp: int = 5761

    @classmethod
    def of(cls, config: FirmwareConfig) -> "Ports":
        """Return the ports of a configuration: the firmware's defaults, or four that start at `autopilot.port`."""
        first = config.port
        return cls(first, first + 1, first + 2, first + 3) if first else cls()


class State(NamedTuple):
    """State of the vehicle as the firmware receives it, world ENU, body FLU."""

    omega_body: Vec3  # [rad/s] of the gyroscope
    specific_force_body: Vec3  # [m/s^2] of the accelerometer
    attitude: Quaternion  # body to world; the firmware uses it as its estimate
    velocity_world: Vec3  # [m/s] of the receiver
    latitude_deg: float
    longitude_deg: float
    height: float  # [m]
    pressure: float  # [Pa]


def state_packet(time: float, s: State) -> bytes:
    """Return the packet for port 9003 at simulation `time` [s]: rates and specific force in FRD, velocity in ENU.

    Both frames of the attitude are turned by half a turn about their x axis, so that (w, x, y, z) becomes
    (w, x, -y, -z).
    """
    (p, q, r), (fx, fy, fz), (w, x, y, z) = s.omega_body, s.specific_force_body, s.attitude
    position = (s.longitude_deg, s.latitude_deg, s.height)
    return STATE.pack(time, p, -q, -r, fx, -fy, -fz, w, x, -y, -z, *s.velocity_world, *position, s.pressure)


def rc_packet(time: float, channels: tuple[int, ...]) -> bytes:
    """Return the packet for port 9004: up to 16 channels [us]; the others are at 1000."""
    return RC.pack(time, *channels, *(RC_LOW,) * (16 - len(channels)))


def parse_motors(data: bytes) -> tuple[float, ...]:
    """Return the four outputs (0 to 1) of a packet of port 9002: front right, rear left, front left, rear right.

    Raises:
        ValueError: another size, or a value that is not finite.
    """
    if len(data) != MOTORS.size:
        raise ValueError(f"{len(data)} bytes; expected {MOTORS.size}")
    result: tuple[float, ...] = MOTORS.unpack(data)
    if not all(map(math.isfinite, result)):
        raise ValueError(f"non-finite motor outputs {result}")
    return result
