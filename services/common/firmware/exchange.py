"""Compiled exchange with a firmware: memory that it shares with Python, and the command that it publishes.

The parameters of an adapter's exchange are a NamedTuple with the `Shared` memory. Its module has `exchange(parameters,
tick)`, which sends the samples of a tick and receives the firmware's outputs. Python is called (`call_python`) only if
the outputs are late or unexpected, and to poll the firmware's MAVLink link.
"""

import ctypes
import time
from typing import Any, NamedTuple

import numpy as np

from lapwing.cosim.diagram.compiled_block import CONTINUE, NON_FINITE, InputRing, ring_index
from lapwing.cosim.diagram.tick_schedule import LATCHED
from lapwing.dynamics.vector import ZERO
from lapwing.kernels import DispatchTable, always_inline
from lapwing.kernels.codegen import dispatch, map_tuple
from lapwing.kernels.native_calls import address_of, call_int, call_long
from lapwing.kernels.row_packing import load, pack_row, store
from lapwing.services.common.firmware.hold import FirmwareCommand
from lapwing.services.common.ports import PerRotor

OPEN, WAIT, SEND, POLL, INVALID = range(5)
"""Reasons to call Python: first exchange; missing or unexpected answer; sending failed; poll due; samples invalid."""
FAILED = -1  # result of an exchange that ends the run; others: 1 if the outputs prove that the vehicle is armed, else 0
ARMED, LANDED, FINISHED, STATUS_TEXT = range(4)  # `flags`
WAITING, FIRST_START, LAST_START, LAST_END = range(4)  # `seconds`


class Shared(NamedTuple):
    """Memory of an exchange, which Python reads and writes."""

    period: int  # [ticks] between two exchanges
    interval: float  # [s] of a tick
    order: tuple[int, ...]  # output that drives each rotor
    none: PerRotor  # zero for each rotor
    command: Any  # row of the port `hold.COMMAND`
    outputs: Any  # (n,) firmware outputs, 0 to 1, one for each rotor
    flags: Any  # int64: state of the vehicle from the MAVLink link, index of the status texts
    next_poll: Any  # (1,) tick
    steps: Any  # (1,) exchanges
    seconds: Any  # [s] total wait; wall time at the start of the first and last exchange, end of the last
    clock: Any  # int64: `struct timespec`
    clock_address: int
    clock_id: int
    clock_gettime: int  # addresses of functions
    python: int  # `python(tick, reason, number) -> 0 to continue`


def shared_memory(config: Any, command: np.ndarray, python: Any) -> Shared:
    """Return the memory of an exchange.

    Args:
        config: `FirmwareConfig` of the adapter.
        command: row of the port `hold.COMMAND`.
        python: ctypes function that compiled code calls.
    """
    clock = np.zeros(2, np.int64)
    return Shared(
        config.period, config.interval, config.order, (0.0,) * len(config.order), command, np.zeros(len(config.order)),
        np.array([0, 1, 0, 0]), np.zeros(1, np.int64), np.zeros(1, np.int64), np.zeros(4), clock, clock.ctypes.data,
        time.CLOCK_MONOTONIC, address_of(ctypes.CDLL(None).clock_gettime), address_of(python),
    )  # fmt: skip


def empty_ring(example: Any) -> InputRing:
    """Return the ring of a port that the vehicle does not have."""
    return InputRing(example, pack_row(example)[None], LATCHED, 0)


@always_inline
def newest(ring: InputRing, tick: int) -> Any:
    """Return the newest sample up to `tick`."""
    return load(ring.example, ring.rows, ring_index(tick, ring.period, ring.rows))


@always_inline
def now(e: Shared) -> float:
    """Return the monotonic wall time [s]."""
    call_int(e.clock_gettime, (e.clock_id, e.clock_address))
    return e.clock[0] + 1e-9 * e.clock[1]


@always_inline
def call_python(e: Shared, tick: int, reason: int, number: int) -> bool:
    """Call Python. Return True if the run continues."""
    return call_long(e.python, (tick, reason, number)) == 0


@always_inline
def _begin(e: Shared, tick: int) -> bool:
    """Count an exchange and store its wall time. Return False without a connection."""
    if e.steps[0] == 0:
        if not call_python(e, tick, OPEN, 0):
            return False
        e.seconds[FIRST_START] = now(e)
    e.seconds[LAST_START] = now(e)
    e.steps[0] += 1
    return True


@always_inline
def _end(e: Shared, tick: int) -> bool:
    """Add the wall time since `_begin` to the waiting time, and poll the other link if it is due.

    Return False if the run ends.
    """
    time = now(e)
    e.seconds[WAITING] += time - e.seconds[LAST_START]
    e.seconds[LAST_END] = time
    return tick < e.next_poll[0] or call_python(e, tick, POLL, 0)


@always_inline
def _duty(outputs_armed: tuple[Any, bool], output: int, _: float) -> float:
    outputs, armed = outputs_armed
    return min(max(outputs[output], 0.0), 1.0) if armed else 0.0


@always_inline
def _publish(e: Shared, running: bool) -> None:
    """Write the command. `running`: the outputs prove that the vehicle is armed."""
    armed, landed = e.flags[ARMED] != 0 or running, e.flags[LANDED] != 0 and not running
    duty = map_tuple(_duty, (e.outputs, armed), e.order, e.none)
    store(FirmwareCommand(duty, armed, landed, e.flags[FINISHED] != 0, e.flags[STATUS_TEXT], ZERO), e.command, 0)


_exchange = dispatch(DispatchTable("exchange"))


@always_inline
def step(p: Any, s: int, tick: int, inputs: tuple) -> tuple[int, tuple, int]:
    """Send the samples at `tick`, receive the outputs, and write the command."""
    e = p.shared
    if tick % e.period != 0:
        return s, (), CONTINUE
    running = FAILED
    if _begin(e, tick):
        running = _exchange(p, tick)
    if running == FAILED or not _end(e, tick):
        return s, (), NON_FINITE
    _publish(e, running != 0)
    return s, (), CONTINUE
