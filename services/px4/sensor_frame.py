"""MAVLink frames of HIL_SENSOR and HIL_ACTUATOR_CONTROLS in compiled code: a step of the lock step is one of each.

Numbers are written through views of the same memory; their offsets are multiples of their size.
Sources: MAVLink guide, "Packet Serialization"; MAVLink common message set.
"""

from typing import Any, NamedTuple

import numpy as np

from lapwing.dynamics.vector import Vec3
from lapwing.kernels import always_inline, kernel, math
from lapwing.services.common.mavlink.dialect import mavlink

SYSTEM, COMPONENT = 1, 51  # ids of the simulator; PX4 does not check them
NONE = (math.nan, math.nan, math.nan)  # no new reading
ACCELEROMETER, GYRO, MAGNETOMETER, BAROMETER, AIRSPEED = 0x7, 0x38, 0x1C0, 0x1A00, 0x400  # fields_updated
TEMPERATURE = 25.0  # [degC] of the sensors, which are not modelled
_MAGIC, _HEAD = mavlink.PROTOCOL_MARKER_V2, 10  # first byte of a frame; [bytes] before the payload
_SENSOR = mavlink.MAVLink_hil_sensor_message
_CONTROLS = mavlink.MAVLink_hil_actuator_controls_message
_SENSOR_ID, _SENSOR_EXTRA, _SENSOR_SIZE = _SENSOR.id, _SENSOR.crc_extra, _SENSOR.unpacker.size
_CONTROLS_ID, _CONTROLS_EXTRA, _CONTROLS_SIZE = _CONTROLS.id, _CONTROLS.crc_extra, _CONTROLS.unpacker.size


def _change(byte: int) -> int:
    """Return the change of the checksum by a byte."""
    crc = mavlink.x25crc()
    crc.crc = 0
    crc.accumulate(bytes([byte]))
    return int(crc.crc)


_CRC = np.array([_change(byte) for byte in range(256)], np.int64)


class Frame(NamedTuple):
    """Bytes of a frame, and views of its payload, which is aligned."""

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


def frame(data: Any = None) -> Frame:
    """Return the views of a frame at the begin of `data`, such as `Channel.sent`, or of memory of its own."""
    data = np.zeros(112, np.uint8)[6:] if data is None else data
    payload = data[_HEAD : _HEAD + 88]
    return Frame(data, payload.view(np.int64), payload.view(np.int32), payload.view(np.float32))


@always_inline
def pressure_altitude(pressure: float) -> float:
    """Return the altitude [m] in the International Standard Atmosphere (below 11 km) of a pressure [Pa]."""
    return 44330.77 * (1.0 - math.pow(max(pressure, 0.0) / 101325.0, 0.190263))


@always_inline
def _put(m: Frame, first: int, v: Vec3, factor: float, bits: int) -> int:
    """Write a vector in FRD. Return its bits of fields_updated, 0 if it has no new reading."""
    if math.isnan(v[0]):
        m.floats[first] = m.floats[first + 1] = m.floats[first + 2] = 0.0
        return 0
    m.floats[first], m.floats[first + 1], m.floats[first + 2] = factor * v[0], -factor * v[1], -factor * v[2]
    return bits


@always_inline
def _crc(data: Any, stop: int, extra: int) -> int:
    """Return the checksum of a frame up to `stop`."""
    crc = 0xFFFF
    for k in range(1, stop):
        crc = crc >> 8 ^ _CRC[(crc ^ data[k]) & 0xFF]
    return crc >> 8 ^ _CRC[(crc ^ extra) & 0xFF]


@always_inline
def write_sensors(m: Frame, sequence: int, time_us: int, s: Sensors) -> int:
    """Write the frame of HIL_SENSOR: FRD, gauss and hPa; id 0, which sets PX4's clock. Return its length [bytes].

    Args:
        m: frame.
        sequence: number of the frame, 0 to 255.
        time_us: time [us].
        s: readings.
    """
    out = m.bytes
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
    size = _SENSOR_SIZE
    out[_HEAD + size - 1] = 0  # id
    while size > 1 and out[_HEAD + size - 1] == 0:
        size -= 1
    out[0], out[1], out[2], out[3], out[4] = _MAGIC, size, 0, 0, sequence
    out[5], out[6], out[7], out[8], out[9] = SYSTEM, COMPONENT, _SENSOR_ID, 0, 0
    crc = _crc(out, _HEAD + size, _SENSOR_EXTRA)
    out[_HEAD + size], out[_HEAD + size + 1] = crc & 0xFF, crc >> 8
    return _HEAD + size + 2


@always_inline
def read_controls(data: Any, size: int, m: Frame) -> bool:
    """Copy HIL_ACTUATOR_CONTROLS into `m`. Return False unless the bytes are exactly one valid frame of it."""
    length = size - _HEAD - 2
    if length < 1 or length > _CONTROLS_SIZE or data[0] != _MAGIC or data[1] != length or data[2] != 0:
        return False
    if data[7] != _CONTROLS_ID or data[8] != 0 or data[9] != 0:
        return False
    crc = _crc(data, size - 2, _CONTROLS_EXTRA)
    if data[size - 2] != crc & 0xFF or data[size - 1] != crc >> 8:
        return False
    for k in range(_HEAD, _HEAD + _CONTROLS_SIZE):
        m.bytes[k] = data[k] if k < size - 2 else 0
    return True


@kernel
def _write(m: Any, sequence: int, time_us: int, s: Any) -> int:
    return write_sensors(m, sequence, time_us, s)


def sensor_frame(sequence: int, time_us: int, s: Sensors) -> bytes:
    """Return the frame of HIL_SENSOR; see `write_sensors`."""
    m = frame()
    return m.bytes[: _write(m, sequence, time_us, s)].tobytes()  # type: ignore[no-any-return]
