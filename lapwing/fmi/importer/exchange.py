"""Compiled exchange of a tick with the process of an FMU: inputs, request, answer, outputs.

Python runs (`wait`) only if the FMU does not answer immediately, or with an error. Two pipes connect the processes. A
request is (time [s], step [s], inputs), an answer is (length of an error text [bytes], outputs), all of type double.
"""

from typing import Any, NamedTuple

from lapwing.cosim.diagram.compiled_block import CONTINUE, NON_FINITE
from lapwing.cosim.diagram.tick_schedule import LATCHED
from lapwing.fmi.importer.pipe_polling import soon_readable
from lapwing.kernels import always_inline, math
from lapwing.kernels.native_calls import call_int, call_long, load_double, store_double

PROMPT = 2  # [ms] wait of compiled code for an answer; then Python waits, which handles signals and time limits


class FmuExchange(NamedTuple):
    """Addresses and tables of an exchange. A ring is four integers: address, bytes of a row, rows - 1, period."""

    interval: float  # [s] length of a tick
    delay: int  # [ticks] delay of the inputs
    request: Any  # array of doubles
    reply: Any  # array of doubles
    request_address: int
    reply_address: int
    channels: Any  # file descriptors of requests and answers
    poll_entry: int  # address of a `struct pollfd` for the answers
    looks: int  # see `pipe_polling.LOOKS`
    write: int  # addresses of C functions
    poll: int
    read: int
    wait: int  # address of `wait(bytes sent, bytes received) -> 0 after the answer has arrived`
    sources: Any  # (n, 6) ring of each input port, first and last + 1 of its connections
    source_places: Any  # (connections, 2) index of an input, place in a row [bytes]
    source_factors: Any  # (connections,)
    targets: Any  # (n, 8) ring of each output port, first and last + 1, ring of the original: address or 0, rows - 1
    target_places: Any  # (connections, 2) index of an output, place in a row [bytes]
    target_factors: Any  # (connections,)


@always_inline
def _row(address: int, size: int, mask: int, period: int, tick: int) -> int:
    """Return the address of the row with the newest sample up to `tick`."""
    return address if period == LATCHED else address + size * ((tick // period) & mask)


@always_inline
def _set_inputs(p: FmuExchange, stamp: int) -> None:
    for k in range(len(p.sources)):
        ring = p.sources[k]
        row = _row(ring[0], ring[1], ring[2], ring[3], stamp)
        for i in range(ring[4], ring[5]):
            place = p.source_places[i]
            p.request[2 + place[0]] = load_double(row + place[1]) * p.source_factors[i]


@always_inline
def _publish(p: FmuExchange, tick: int) -> None:
    for k in range(len(p.targets)):
        ring = p.targets[k]
        if tick % ring[3] != 0:
            continue
        row = _row(ring[0], ring[1], ring[2], ring[3], tick)
        if ring[6] != 0:
            original = _row(ring[6], ring[1], ring[7], ring[3], tick)
            for offset in range(0, ring[1], 8):
                store_double(row + offset, load_double(original + offset))
        for i in range(ring[4], ring[5]):
            place = p.target_places[i]
            store_double(row + place[1], p.reply[1 + place[0]] * p.target_factors[i])


@always_inline
def _answered(p: FmuExchange) -> bool:
    """Send the request. Return True after an answer without error."""
    size, received = 8 * len(p.request), 0
    sent = call_long(p.write, (p.channels[0], p.request_address, size))
    prompt = sent == size and (
        soon_readable(p.poll, p.poll_entry, p.looks) or call_int(p.poll, (p.poll_entry, 1, PROMPT)) == 1
    )
    if prompt:
        size = 8 * len(p.reply)
        received = call_long(p.read, (p.channels[1], p.reply_address, size))
        if received == size and p.reply[0] == 0.0:
            return True
    return call_long(p.wait, (sent, received)) == 0


@always_inline
def step(p: FmuExchange, s: int, tick: int, inputs: tuple) -> tuple[int, tuple, int]:
    """Step the FMU to `tick`, and publish its outputs. The status is NON_FINITE if the FMU failed."""
    p.request[0], p.request[1] = ((tick - 1) * p.interval, p.interval) if tick > 0 else (0.0, -1.0)
    if tick >= p.delay:
        _set_inputs(p, tick - p.delay)
    if not _answered(p):
        return s, (), NON_FINITE
    for i in range(1, len(p.reply)):
        if not math.isfinite(p.reply[i]):
            return s, (), NON_FINITE
    _publish(p, tick)
    return s, (), CONTINUE
