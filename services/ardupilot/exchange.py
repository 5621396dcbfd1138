"""Compiled exchange of a step with ArduPilot: state message, servo packet, motor outputs."""

from typing import Any, NamedTuple

from lapwing.cosim.diagram.compiled_block import CONTINUE, NON_FINITE
from lapwing.kernels import always_inline
from lapwing.services.ardupilot.resolve import LOOP_RATE
from lapwing.services.ardupilot.sample import Samples, extras, vehicle_state
from lapwing.services.ardupilot.servo_packet import MAGIC_16, MAGIC_32, PULSE_MAX, throttle
from lapwing.services.ardupilot.state_message import INVALID as NOT_WRITTEN
from lapwing.services.ardupilot.state_message import write_state
from lapwing.services.common.firmware.datagrams import Datagrams, is_from_peer, receive, send, unsigned16
from lapwing.services.common.firmware.exchange import (
    INVALID,
    SEND,
    WAIT,
    Shared,
    begin,
    call_python,
    end,
    publish,
)  # fmt: skip

MARGIN = 1e-9  # [s] added to each step: ArduPilot cuts steps to whole microseconds
PWM_MIN, PWM_MAX = 1000.0, 2000.0  # [us] MOT_PWM_MIN and MOT_PWM_MAX
OUTPUTS = 4
_HEAD = 8  # [bytes] before the pulse widths


class ArduPilotExchange(NamedTuple):
    """Parameters of the exchange."""

    shared: Shared
    samples: Samples
    datagrams: Datagrams
    next_count: Any  # (1,) frame count of the next servo packet


@always_inline
def _is_expected(p: ArduPilotExchange, size: int) -> bool:
    """Return True if the datagram is the next servo packet and valid, so that Python need not check it."""
    data, magic = p.datagrams.received, unsigned16(p.datagrams.received, 0)
    if not ((size == 40 and magic == MAGIC_16) or (size == 72 and magic == MAGIC_32)) or not is_from_peer(p.datagrams):
        return False
    count = unsigned16(data, 4) | unsigned16(data, 6) << 16
    if count != p.next_count[0] or unsigned16(data, 2) <= LOOP_RATE:
        return False
    longest = 0
    for at in range(_HEAD, size, 2):
        longest = max(longest, unsigned16(data, at))
    return longest <= PULSE_MAX


@always_inline
def step(p: ArduPilotExchange, s: int, tick: int, inputs: tuple) -> tuple[int, tuple, int]:
    """Answer the last servo packet with the state at `tick`, and receive the next packet."""
    e, d = p.shared, p.datagrams
    if tick % e.period != 0:
        return s, (), CONTINUE
    if not begin(e, tick):
        return s, (), NON_FINITE
    time = tick * e.interval
    size = write_state(d.sent, time + tick * MARGIN, vehicle_state(p.samples, tick), extras(p.samples, tick))
    if size == NOT_WRITTEN:
        call_python(e, tick, INVALID, 0)
        return s, (), NON_FINITE
    d.sent_size[0] = size
    if not send(d) and not call_python(e, tick, SEND, 0):
        return s, (), NON_FINITE
    size = receive(d)
    if _is_expected(p, size):
        p.next_count[0] += 1
        for k in range(OUTPUTS):
            e.outputs[k] = throttle(unsigned16(d.received, _HEAD + 2 * k), PWM_MIN, PWM_MAX)
    elif not call_python(e, tick, WAIT, size):
        return s, (), NON_FINITE
    if not end(e, tick):
        return s, (), NON_FINITE
    running = False
    for k in range(OUTPUTS):
        running = running or e.outputs[k] > 0.0
    publish(e, running)  # a heartbeat comes only once a second
    return s, (), CONTINUE
