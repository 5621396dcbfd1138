"""Compiled exchange of a step with PX4: HIL_SENSOR, HIL_ACTUATOR_CONTROLS, motor outputs; each reading is sent once."""

from typing import Any, NamedTuple

from lapwing.cosim.diagram.compiled_block import InputRing
from lapwing.kernels import always_inline, math
from lapwing.services.common.firmware.channel import Channel, receive, send
from lapwing.services.common.firmware.exchange import FAILED, SEND, WAIT, Shared, call_python, newest, step
from lapwing.services.px4.messages import ARMED, LOCK_STEP
from lapwing.services.px4.sensor_frame import NONE, Frame, Sensors, read_controls, write_sensors

__all__ = ["step"]
MESSAGES = 100  # reason to call Python: append the messages of `rare_messages`
_IMU, _MAGNETOMETER, _BAROMETER, _AIRSPEED = range(4)


class Readings(NamedTuple):
    """Rings and periods of the ports of HIL_SENSOR."""

    imu: InputRing
    magnetometer: InputRing
    barometer: InputRing
    airspeed: InputRing
    periods: Any  # (n,) int64 [ticks] period of these ports, then of those in `rare_messages`; 0: none
    step: int  # [ticks] between two exchanges


class Px4Exchange(NamedTuple):
    """Parameters of the exchange."""

    shared: Shared
    readings: Readings
    channel: Channel
    sensor: Frame  # in `channel.sent`
    controls: Frame
    sequence: Any  # (1,) int64 number of the next frame, 0 to 255
    rest: Any  # (1,) int64 [bytes] of an incomplete frame, which Python stores
    epoch: Any  # (1,) int64 [us] of PX4's clock at tick 0
    interval_ns: int
    armed: Any  # (1,) int64: 1 if the motors are armed in the last outputs
    silent: Any  # (1,) int64: consecutive steps without an answer
    answers: Any  # (1,) int64: 1 if the firmware answers every message


@always_inline
def is_new(period: int, step: int, tick: int) -> bool:
    """Return True if a port of this period [ticks] has a reading later than the exchange `step` ticks ago."""
    return period > 0 and tick % period < step


@always_inline
def _has_rare(p: Readings, tick: int) -> bool:
    result = False
    for k in range(_AIRSPEED + 1, len(p.periods)):
        result = result or is_new(p.periods[k], p.step, tick)
    return result


@always_inline
def _sensors(p: Readings, tick: int) -> Sensors:
    """Return the new readings of HIL_SENSOR."""
    imu, magnetometer = newest(p.imu, tick), newest(p.magnetometer, tick)
    barometer, airspeed = newest(p.barometer, tick), newest(p.airspeed, tick)
    omega = force = field = NONE
    pressure = dynamic = math.nan
    if is_new(p.periods[_IMU], p.step, tick) and imu.valid:
        omega, force = imu.omega_body, imu.specific_force_body
    if is_new(p.periods[_MAGNETOMETER], p.step, tick) and magnetometer.valid:
        field = magnetometer.field_body
    if is_new(p.periods[_BAROMETER], p.step, tick) and barometer.valid:
        pressure = barometer.pressure
    if is_new(p.periods[_AIRSPEED], p.step, tick) and airspeed.valid:
        dynamic = airspeed.pressure
    return Sensors(omega, force, field, pressure, dynamic)


@always_inline
def _is_answer(p: Px4Exchange, size: int, time_us: int) -> bool:
    """Return True if the bytes are the complete and valid answer to `time_us`; store its outputs."""
    m = p.controls
    if p.rest[0] != 0 or not read_controls(p.channel.received, size, m):
        return False
    if m.words[0] != time_us or m.words[1] & LOCK_STEP == 0:
        return False
    for k in range(len(p.shared.outputs)):
        if not math.isfinite(m.floats[4 + k]):
            return False
    for k in range(len(p.shared.outputs)):
        p.shared.outputs[k] = m.floats[4 + k]
    p.armed[0], p.silent[0] = m.bytes[90] & ARMED != 0, 0
    return True


@always_inline
def exchange(p: Px4Exchange, tick: int) -> int:
    """Send the readings at `tick`, and receive the outputs of the same time. Return 1 if armed, 0, or FAILED."""
    e, c = p.shared, p.channel
    time_us = p.epoch[0] + tick * p.interval_ns // 1000
    values = _sensors(p.readings, tick)
    c.sent_size[0] = write_sensors(p.sensor, p.sequence[0], time_us, values)
    p.sequence[0] = (p.sequence[0] + 1) & 0xFF
    if _has_rare(p.readings, tick) and not call_python(e, tick, MESSAGES, 0):
        return FAILED
    if not send(c) and not call_python(e, tick, SEND, 0):
        return FAILED
    if p.answers[0] != 0 or not math.isnan(values.omega_body[0]):  # without rates PX4 sends no outputs
        size = receive(c)
        expected = size < 0 or not math.isnan(values.omega_body[0])
        if not _is_answer(p, size, time_us) and expected and not call_python(e, tick, WAIT, size):
            return FAILED
    return int(p.armed[0])
