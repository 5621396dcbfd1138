"""Compiled exchange of a step with PX4: HIL_SENSOR, HIL_ACTUATOR_CONTROLS, motor outputs."""

from typing import Any, NamedTuple

from lapwing.cosim.diagram.compiled_block import CONTINUE, NON_FINITE
from lapwing.kernels import always_inline, math
from lapwing.services.common.firmware.exchange import SEND, WAIT, Shared, begin, call_python, end, publish
from lapwing.services.px4.messages import ARMED, LOCK_STEP
from lapwing.services.px4.sample import Readings, has_rare, sensors
from lapwing.services.px4.sensor_frame import Payload, read_controls, write_sensors
from lapwing.services.px4.stream import Stream, receive, send

OUTPUTS = 4
MESSAGES = 100  # reason to call Python: append the rare messages


class Px4Exchange(NamedTuple):
    """Parameters of the exchange."""

    shared: Shared
    readings: Readings
    stream: Stream
    sensor: Payload
    controls: Payload
    epoch: Any  # (1,) int64 [us] of PX4's clock at tick 0
    interval_ns: int
    armed: Any  # (1,) int64: 1 if the motors are armed in the last outputs
    silent: Any  # (1,) int64: consecutive steps without an answer


@always_inline
def _is_answer(p: Px4Exchange, size: int, time_us: int) -> bool:
    """Return True if the bytes are the complete and valid answer to `time_us`; store its outputs."""
    m = p.controls
    if p.stream.rest[0] != 0 or not read_controls(p.stream.received, size, m):
        return False
    if m.words[0] != time_us or m.words[1] & LOCK_STEP == 0:
        return False
    for k in range(OUTPUTS):
        if not math.isfinite(m.floats[4 + k]):
            return False
    for k in range(OUTPUTS):
        p.shared.outputs[k] = m.floats[4 + k]
    p.armed[0], p.silent[0] = m.bytes[80] & ARMED != 0, 0
    return True


@always_inline
def step(p: Px4Exchange, s: int, tick: int, inputs: tuple) -> tuple[int, tuple, int]:
    """Send the readings at `tick`, and receive the outputs of the same time."""
    e, stream = p.shared, p.stream
    if tick % e.period != 0:
        return s, (), CONTINUE
    if not begin(e, tick):
        return s, (), NON_FINITE
    time_us = p.epoch[0] + tick * p.interval_ns // 1000
    values = sensors(p.readings, tick)
    stream.sent_size[0] = write_sensors(stream.sent, p.sensor, stream.sequence[0], time_us, values)
    stream.sequence[0] = (stream.sequence[0] + 1) & 0xFF
    if has_rare(p.readings, tick) and not call_python(e, tick, MESSAGES, 0):
        return s, (), NON_FINITE
    if not send(stream) and not call_python(e, tick, SEND, 0):
        return s, (), NON_FINITE
    if not math.isnan(values.omega_body[0]):  # without rates PX4 sends no outputs
        size = receive(stream)
        if not _is_answer(p, size, time_us) and not call_python(e, tick, WAIT, size):
            return s, (), NON_FINITE
    if not end(e, tick):
        return s, (), NON_FINITE
    publish(e, p.armed[0] != 0)
    return s, (), CONTINUE
