"""Compiled step of an FMU for co-simulation, and the loop that serves a run without Python between two ticks."""

from typing import Any, NamedTuple

from lapwing.fmi.importer.pipe_polling import soon_readable
from lapwing.kernels import always_inline, kernel
from lapwing.kernels.native_calls import call_int, call_long

WARNING = 1  # highest FMI status of success
UPDATES = 1000  # limit of discrete state updates at one time, and of events in a step
DONE, CLOSED, INTERRUPTED, ENDED, UNSETTLED, STUCK, MANY, SET, GET, DO_STEP, ENTER_EVENT, UPDATE, ENTER_STEP = range(13)
"""Results: stepped; other end closed; read interrupted; end requested; three kinds of no progress; a function failed.
"""
FUNCTIONS = {
    SET: "set", GET: "get", DO_STEP: "doStep", ENTER_EVENT: "enterEventMode", UPDATE: "updateDiscreteStates",
    ENTER_STEP: "enterStepMode",
}  # fmt: skip


class FmuCalls(NamedTuple):
    """Functions of an FMU and the memory that they use."""

    component: int
    do_step: int  # addresses of the FMU's functions
    enter_event_mode: int
    update_discrete_states: int
    enter_step_mode: int
    is_3: bool  # True for FMI 3.0
    event_mode: bool
    sets: Any  # (n, 5) function, references, number of references, values, number of values
    gets: Any
    inputs: Any  # bits of the inputs, int64
    former: Any  # bits of the inputs that were set last
    flags: Any  # bytes: doStep: event needed, terminate, early; update: again, terminate, nominals, values, has time
    flags_address: int
    times: Any  # [s] reached by doStep, next time event, without progress, of the requested end (NaN: none)
    times_address: int


class Channel(NamedTuple):
    """Pipes to the run."""

    requests: int  # file descriptors
    replies: int
    request: Any  # array of doubles
    reply: Any
    request_address: int
    reply_address: int
    received: Any  # (1,) received bytes of the current request
    poll_entry: Any  # `struct pollfd` of the requests
    poll_entry_address: int
    looks: int  # see `pipe_polling.LOOKS`
    poll: int  # addresses of C functions
    read: int
    write: int


@always_inline
def _move(groups: Any, component: int) -> int:
    """Set or get all variables. Return the worst status."""
    worst = 0
    for k in range(len(groups)):
        g = groups[k]
        worst = max(worst, call_int(g[0], (component, g[1], g[2], g[3], g[4])))
    return worst


@always_inline
def _changed(c: FmuCalls) -> bool:
    changed = False
    for k in range(len(c.inputs)):
        changed = changed or c.inputs[k] != c.former[k]
    return changed


@always_inline
def _update(c: FmuCalls, time: float) -> tuple[int, int]:
    """Update discrete states until they converge."""
    flags, at = c.flags_address, c.times_address + 8
    for _ in range(UPDATES):
        addresses = (c.component, flags + 3, flags + 4, flags + 5, flags + 6, flags + 7, at)
        status = call_int(c.update_discrete_states, addresses)
        if status > WARNING:
            return UPDATE, status
        if c.flags[4] != 0:
            c.times[3] = time
        if c.flags[3] == 0 or c.flags[4] != 0:
            return DONE, 0
    return UNSETTLED, 0


@always_inline
def _event(c: FmuCalls, time: float, with_inputs: bool) -> tuple[int, int]:
    status = call_int(c.enter_event_mode, (c.component,))
    if status > WARNING:
        return ENTER_EVENT, status
    if with_inputs:
        status = _move(c.sets, c.component)
        if status > WARNING:
            return SET, status
        c.former[:] = c.inputs
    result = _update(c, time)
    if result[0] == DONE:
        status = call_int(c.enter_step_mode, (c.component,))
        if status > WARNING:
            return ENTER_STEP, status
    return result


@always_inline
def _do_step(c: FmuCalls, time: float, step: float) -> tuple[int, int]:
    """Step to the end, across events at which the FMU returns early."""
    flags, stop, at = c.flags_address, time + step, time
    for _ in range(UPDATES if c.is_3 else 1):
        rest = stop - at if c.is_3 else step
        arguments = (c.component, at, rest, 1, flags, flags + 1, flags + 2, c.times_address)  # FMI 2.0 has the first 4
        status = call_int(c.do_step, arguments)
        if status > WARNING:
            return DO_STEP, status
        if not c.is_3:
            return DONE, 0
        reached = c.times[0] if c.flags[2] != 0 else at + rest
        needed = c.flags[0] != 0
        if c.flags[1] != 0:
            c.times[3] = reached
        if c.event_mode and needed:
            result = _event(c, reached, False)
            if result[0] != DONE:
                return result
        if reached >= stop - 1e-9 * step or c.times[3] == c.times[3]:
            return DONE, 0
        if reached <= at and not needed:
            c.times[2] = at
            return STUCK, 0
        at = reached
    return MANY, 0


@always_inline
def _step(c: FmuCalls, time: float, step: float) -> tuple[int, int]:
    if c.times[3] == c.times[3]:
        return ENDED, 0
    if not c.event_mode:
        status = _move(c.sets, c.component)
        if status > WARNING:
            return SET, status
    elif _changed(c):
        result = _event(c, time, True)
        if result[0] != DONE:
            return result
    result = _do_step(c, time, step)
    if result[0] != DONE:
        return result
    status = _move(c.gets, c.component)
    return (GET, status) if status > WARNING else (DONE, 0)


@kernel
def step_once(calls: Any, time: float, step: float) -> tuple[int, int]:
    """Set the inputs, step from `time` by `step` [s], and get the outputs. Return (result, status of FMI)."""
    return _step(calls.value, time, step)


@kernel
def serve(calls: Any, channel: Any) -> tuple[int, int]:
    """Answer requests until one fails. Return (result, status of FMI)."""
    c, io = calls.value, channel.value
    while True:
        size = 8 * len(io.request)
        soon_readable(io.poll, io.poll_entry_address, io.looks)  # otherwise `read` sleeps
        while io.received[0] < size:
            actual = io.received[0]
            n = call_long(io.read, (io.requests, io.request_address + actual, size - actual))
            if n <= 0:
                return (CLOSED, 0) if n == 0 else (INTERRUPTED, 0)
            io.received[0] = actual + n
        io.received[0] = 0
        result = _step(c, io.request[0], io.request[1])
        if result[0] != DONE:
            return result
        sent, size = 0, 8 * len(io.reply)
        while sent < size:
            n = call_long(io.write, (io.replies, io.reply_address + sent, size - sent))
            if n < 0:
                return CLOSED, 0
            sent += n
