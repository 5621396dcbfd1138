"""Servo packets of ArduPilot's JSON interface, and the sequence of their frame counts.

A packet is little-endian: magic, rate [Hz], frame count, and 16 pulse widths [us], or 32 with SERVO_32_ENABLE.
Source: ArduPilot, libraries/SITL/examples/JSON/readme.md. ArduPilot sends a frame again, with the same count, if its
answer does not arrive within about a second. Such a frame is answered but does not step the plant.
"""

import struct
from collections.abc import Mapping
from typing import NamedTuple

from lapwing.kernels import always_inline

MAGIC_16, MAGIC_32 = 18458, 29569
_HEAD = struct.Struct("<HHI")
_LAYOUTS = {MAGIC_16: struct.Struct("<HHI16H"), MAGIC_32: struct.Struct("<HHI32H")}
PULSE_MAX = 3000  # [us] longest plausible pulse; 0: the channel is unused
PULSE_LOW, PULSE_HIGH = 1000.0, 2000.0  # [us] of motors at rest and at full throttle
ANY = -1  # expected count before the first frame of a program
RESENT, RESTARTED = -1, -2  # the last frame again; a lower count: the program has restarted


class ServoPacket(NamedTuple):
    """One output of ArduPilot."""

    frame_rate: int  # [Hz] requested steps per second, SIM_RATE_HZ
    frame_count: int  # increases by 1 per step
    pwm: tuple[int, ...]  # [us] 16 or 32 channels


def decode(data: bytes) -> ServoPacket:
    """Return the packet in a datagram.

    Raises:
        ValueError: (one line) the datagram is not a servo packet; the text states the reason.
    """
    if len(data) < _HEAD.size:
        raise ValueError(f"{len(data)} bytes, a servo packet has 40 or 72")
    magic, rate, count = _HEAD.unpack_from(data)
    layout = _LAYOUTS.get(magic)
    if layout is None:
        raise ValueError(f"magic number {magic}, expected {MAGIC_16} or {MAGIC_32}")
    if len(data) != layout.size:
        raise ValueError(f"{len(data)} bytes with magic number {magic}, expected {layout.size}")
    pwm = layout.unpack(data)[3:]
    if rate == 0:
        raise ValueError("frame rate 0")
    if max(pwm) > PULSE_MAX:
        raise ValueError(f"pulse width of {max(pwm)} us, expected at most {PULSE_MAX}")
    return ServoPacket(rate, count, pwm)


def pulse_range(parameters: Mapping[str, float]) -> tuple[float, float]:
    """Return the pulses [us] of motors at rest and at full throttle from ArduPilot's parameters."""
    return parameters.get("MOT_PWM_MIN", 0.0) or PULSE_LOW, parameters.get("MOT_PWM_MAX", 0.0) or PULSE_HIGH


@always_inline
def throttle(pwm: int, low: float, high: float) -> float:
    """Return the fraction, 0 to 1, of a pulse width [us] in the range of a motor; 0 of an unused channel."""
    return min(max((pwm - low) / (high - low), 0.0), 1.0)


def frames_ahead(count: int, expected: int) -> int:
    """Return by how many frames a count is ahead of the expected one: RESENT, RESTARTED, or the frames skipped."""
    ahead = 0 if expected == ANY else (count - expected) & 0xFFFFFFFF
    return RESENT if ahead == 0xFFFFFFFF else RESTARTED if ahead >= 1 << 31 else ahead
