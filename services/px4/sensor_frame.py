"""MAVLink frames of HIL_SENSOR and HIL_ACTUATOR_CONTROLS in compiled code: a step of the lock step is one of each.

Numbers are written through views of the same memory; their offsets are multiples of their size.
Sources: MAVLink guide, "Packet Serialization"; MAVLink common message set.
"""

from typing import Any, NamedTuple

import numpy as np

from lapwing.dynamics.vector import Vec3
from lapwing.kernels import always_inline, kernel, math
from lapwing.services.px4.framing import V2, checksum
from lapwing.services.px4.messages import (
    ACCELEROMETER,
    AIRSPEED,
    BAROMETER,
    GYRO,
    HIL_ACTUATOR_CONTROLS,
    HIL_SENSOR,
    MAGNETOMETER,
    TEMPERATURE,
)

SYSTEM, COMPONENT = 1, 51  # ids of the simulator; PX4 does not check them
NONE = (math.nan, math.nan, math.nan)  # no new reading
_HEAD, _MASK, _END = 10, 60, 65  # [bytes] size of a header; offset of fields_updated; length of HIL_SENSOR
_CONTROLS_END = HIL_ACTUATOR_CONTROLS.fields.size
_SENSOR, _SENSOR_EXTRA = HIL_SENSOR.number, HIL_SENSOR.extra
_CONTROLS, _CONTROLS_EXTRA = HIL_ACTUATOR_CONTROLS.number, HIL_ACTUATOR_CONTROLS.extra
_CRC = np.array([checksum(bytes([byte]), 0) for byte in range(256)], np.int64)  # change of the checksum by each byte


class Payload(NamedTuple):
    """Views of the payload of a message, 88 bytes."""

    bytes: Any
    words: Any  # int64
    integers: Any  # int32
    floats: Any  # float32


class Sensors(NamedTuple):
    """Readings of one step, body FLU; NaN: not updated."""

    omega_body: Vec3 = NONE  # [rad/s]
    specific_force_body: Vec3 = NONE  # [m/s^2]
    field_body: Vec3 = NONE  # [T]
    pressure: float = math.nan  # [Pa]
    dynamic_pressure: float = math.nan  # [Pa]


def payload() -> Payload:
    """Return the memory of a payload."""
    data = np.zeros(88, np.uint8)
    return Payload(data, data.view(np.int64), data.view(np.int32), data.view(np.float32))


@always_inline
def pressure_altitude(pressure: float) -> float:
    """Return the altitude [m] in the International Standard Atmosphere (below 11 km) of a pressure [Pa]."""
    return 44330.77 * (1.0 - math.pow(max(pressure, 0.0) / 101325.0, 0.190263))


@always_inline
def _put(m: Payload, first: int, v: Vec3, factor: float, bits: int) -> int:
    """Write a vector in FRD. Return its bits of fields_updated, 0 if it has no new reading."""
    if math.isnan(v[0]):
        m.floats[first] = m.floats[first + 1] = m.floats[first + 2] = 0.0
        return 0
    m.floats[first], m.floats[first + 1], m.floats[first + 2] = factor * v[0], -factor * v[1], -factor * v[2]
    return bits


@always_inline
def _crc(data: Any, first: int, stop: int, extra: int) -> int:
    crc = 0xFFFF
    for k in range(first, stop):
        crc = crc >> 8 ^ _CRC[(crc ^ data[k]) & 0xFF]
    return crc >> 8 ^ _CRC[(crc ^ extra) & 0xFF]


@always_inline
def write_sensors(out: Any, m: Payload, sequence: int, time_us: int, s: Sensors) -> int:
    """Write the frame of HIL_SENSOR: FRD, gauss and hPa; id 0, which sets PX4's clock. Return its length [bytes].

    Args:
        out: buffer of bytes.
        m: memory for the payload.
        sequence: number of the frame, 0 to 255.
        time_us: time [us].
        s: readings.
    """
    m.words[0] = time_us
    mask = _put(m, 2, s.specific_force_body, 1.0, ACCELEROMETER) | _put(m, 5, s.omega_body, 1.0, GYRO)
    mask |= _put(m, 8, s.field_body, 1e4, MAGNETOMETER)
    m.floats[11] = m.floats[12] = m.floats[13] = 0.0
    if not math.isnan(s.pressure):
        m.floats[11], m.floats[13] = 0.01 * s.pressure, pressure_altitude(s.pressure)
        mask |= BAROMETER
    if not math.isnan(s.dynamic_pressure):
        m.floats[12] = 0.01 * s.dynamic_pressure
        mask |= AIRSPEED
    m.floats[14] = TEMPERATURE
    m.integers[15] = mask
    m.bytes[64] = 0
    size = _END
    while size > 1 and m.bytes[size - 1] == 0:
        size -= 1
    out[0], out[1], out[2], out[3], out[4] = V2, size, 0, 0, sequence
    out[5], out[6], out[7], out[8], out[9] = SYSTEM, COMPONENT, _SENSOR, 0, 0
    for k in range(size):
        out[_HEAD + k] = m.bytes[k]
    crc = _crc(out, 1, _HEAD + size, _SENSOR_EXTRA)
    out[_HEAD + size], out[_HEAD + size + 1] = crc & 0xFF, crc >> 8
    return _HEAD + size + 2


@always_inline
def read_controls(data: Any, size: int, m: Payload) -> bool:
    """Read the payload of HIL_ACTUATOR_CONTROLS. Return False unless the bytes are exactly one valid frame of it."""
    length = size - _HEAD - 2
    if length < 1 or length > _CONTROLS_END or data[0] != V2 or data[1] != length or data[2] != 0:
        return False
    if data[7] != _CONTROLS or data[8] != 0 or data[9] != 0:
        return False
    crc = _crc(data, 1, size - 2, _CONTROLS_EXTRA)
    if data[size - 2] != crc & 0xFF or data[size - 1] != crc >> 8:
        return False
    for k in range(_CONTROLS_END):
        m.bytes[k] = data[_HEAD + k] if k < length else 0
    return True


@kernel
def _write(out: Any, m: Any, sequence: int, time_us: int, s: Any) -> int:
    return write_sensors(out, m, sequence, time_us, s)


def sensor_frame(sequence: int, time_us: int, s: Sensors) -> bytes:
    """Return the frame of HIL_SENSOR; see `write_sensors`."""
    out = np.zeros(_HEAD + _END + 2, np.uint8)
    return out[: _write(out, payload(), sequence, time_us, s)].tobytes()
