"""Watchdog: after a signal, ends a process whose block does not return, whatever it does.

Python handles a signal between two of its instructions, so that neither compiled code nor a library that holds the GIL
can be interrupted. The watchdog is a thread in compiled code: it sleeps until Python's C handler writes the number of a
signal into a pipe (`signal.set_wakeup_fd`), and needs no GIL to print its line and to end the process. Time in which
the main thread waits for a processor does not count.
"""

import ctypes
import os
import signal
import threading
from time import CLOCK_MONOTONIC
from typing import NamedTuple, Self

import numba
import numpy as np

from lapwing.cosim.diagram.compiled_loop import COMPILING, IDLE, NAMES, RUNNING
from lapwing.cosim.processes.interrupt import ENDING, Interrupted
from lapwing.cosim.processes.patience import EXTENSION
from lapwing.cosim.run_errors import END_SIGNAL
from lapwing.kernels import always_inline, kernel
from lapwing.kernels.native_calls import address_of, call_int, call_long, poll_entry

LIMIT = 4.0  # [s] from the signal to the end of this process
SERVICE_LIMIT = 1.5  # [s] for a block of a service, which the launcher kills later
PERIOD_MS = 20  # [ms] between two checks
_QUIT = 0  # written into the pipe in place of a signal


class Watch(NamedTuple):
    """Data of the compiled thread. Addresses of arrays are those of the arrays before them."""

    read: int  # addresses of C functions
    pread: int
    poll: int
    write: int
    exit: int
    clock_gettime: int
    signals: int  # descriptor of the pipe
    schedule: int  # descriptor of the main thread's `schedstat`, -1 without one
    poll_entry: np.ndarray  # (1,) int64
    poll_address: int
    buffer: np.ndarray  # (64,) uint8
    buffer_address: int
    time: np.ndarray  # (2,) int64: `struct timespec`
    time_address: int
    line: np.ndarray  # (256,) uint8
    line_address: int
    running: np.ndarray  # `RUNNING`
    names: np.ndarray  # `NAMES`
    prefixes: np.ndarray  # (n, m) uint8, by signal, padded with zeros: start of the line; empty for others
    words: np.ndarray  # (4, m) uint8: around the name of a block, in place of it, and before compiling services
    limit: float  # [s] for a block, or for the compilation
    idle_limit: float  # [s] while no block runs


class Watchdog:
    """Context manager: during the block, a signal that does not end this process makes the watchdog end it.

    The process ends by exit code 128 + signal, with one line on standard error that names the block that runs, or the
    services whose kernels compile. A loop whose ticks advance is not ended.
    """

    _thread: threading.Thread | None = None

    def __init__(self, limit: float = LIMIT, idle_limit: float = LIMIT):
        """Prepare the watchdog.

        Args:
            limit: [s] from the signal until a block that does not return is ended.
            idle_limit: [s] for all code outside of blocks.
        """
        self._limits = limit, idle_limit

    def __enter__(self) -> Self:
        if threading.current_thread() is not threading.main_thread():
            return self  # only the main thread has signal handlers
        reader, self._pipe = os.pipe()
        os.set_blocking(self._pipe, False)
        self._data = _watch_data(reader, *self._limits)
        _watch.compile((numba.typeof(self._data),))  # type: ignore[attr-defined] # the thread waits for no compiler
        self._thread = threading.Thread(target=_watch, args=(self._data,), daemon=True, name="watchdog")
        self._thread.start()
        self._before = signal.set_wakeup_fd(self._pipe, warn_on_full_buffer=False)
        return self

    def __exit__(self, *_: object) -> None:
        if self._thread is None:
            return
        signal.set_wakeup_fd(self._before)
        os.write(self._pipe, bytes([_QUIT]))
        self._thread.join()
        for number in (self._pipe, self._data.signals, self._data.schedule):
            if number >= 0:
                os.close(number)


def _table(texts: list[str]) -> np.ndarray:
    """Return texts as UTF-8, padded with at least one zero, shape (n, longest + 1)."""
    width = max(map(len, texts)) + 1
    return np.array([list(text.encode().ljust(width, b"\0")) for text in texts], np.uint8)


def _watch_data(pipe: int, limit: float, idle_limit: float) -> Watch:
    libc = ctypes.CDLL(None)
    try:
        schedule = os.open(f"/proc/self/task/{threading.get_native_id()}/schedstat", os.O_RDONLY | os.O_CLOEXEC)
    except OSError:  # the system has no such file
        schedule = -1
    ending = {*ENDING, END_SIGNAL}  # a service gets the second from its launcher, also where nohup ignores SIGHUP
    starts = [f"lapwing: {Interrupted(n)}; " if n in ending else "" for n in range(signal.NSIG)]
    words = _table(["block ", " did not return\n", "the program did not end by itself\n", "compiling kernels of "])
    arrays = [poll_entry(pipe), np.zeros(64, np.uint8), np.zeros(2, np.int64), np.zeros(256, np.uint8)]
    functions = (libc.read, libc.pread, libc.poll, libc.write, libc._exit, libc.clock_gettime)
    addressed = [part for array in arrays for part in (array, array.ctypes.data)]
    numbers = (*map(address_of, functions), pipe, schedule)
    return Watch._make([*numbers, *addressed, RUNNING, NAMES, _table(starts), words, limit, idle_limit])


@always_inline
def _now(w: Watch) -> float:
    """Return the time of the monotonic clock [s]."""
    call_int(w.clock_gettime, (CLOCK_MONOTONIC, w.time_address))
    return w.time[0] + 1e-9 * w.time[1]


@always_inline
def _starved(w: Watch) -> float:
    """Return the time that the main thread has waited for a processor [s]: the second number of its `schedstat`."""
    size = call_long(w.pread, (w.schedule, w.buffer_address, 64, 0)) if w.schedule >= 0 else 0
    word, value = 0, 0
    for i in range(size):
        digit = int(w.buffer[i]) - 48
        if digit < 0 or digit > 9:
            word += 1
        elif word == 1:
            value = 10 * value + digit
    return 1e-9 * value


@always_inline
def _next_signal(w: Watch, wait_ms: int) -> int:
    """Return the next byte of the pipe, -1 if none arrives within `wait_ms` (-1: forever)."""
    if call_int(w.poll, (w.poll_address, 1, wait_ms)) < 1:
        return -1
    return int(w.buffer[0]) if call_long(w.read, (w.signals, w.buffer_address, 1)) == 1 else -1


@always_inline
def _append(w: Watch, size: int, text: np.ndarray) -> int:
    """Append a text to the line of `size` bytes. Return its new size."""
    for i in range(len(text)):
        if text[i] == 0:
            break
        w.line[size] = text[i]
        size += 1
    return size


@always_inline
def _report(w: Watch, number: int) -> None:
    """Print the line about the signal and the block that runs."""
    size, block = _append(w, 0, w.prefixes[number]), w.running[0]
    if block == IDLE:
        size = _append(w, size, w.words[2])
    elif block == COMPILING:
        size = _append(w, size, w.words[3])
        size = _append(w, size, w.names[block])
        w.line[size] = 10  # end of the line
        size += 1
    else:
        size = _append(w, size, w.words[0])
        size = _append(w, size, w.names[block])
        size = _append(w, size, w.words[1])
    call_long(w.write, (2, w.line_address, size))


@kernel
def _watch(w: Watch) -> int:
    """Wait for a signal, then until nothing proceeds in this process for the time limit, and end it."""
    number = -1
    while number < 0 or (number != _QUIT and w.prefixes[number, 0] == 0):
        number = _next_signal(w, -1)
    block, tick, since, starved = w.running[0], w.running[1], _now(w), _starved(w)
    while number != _QUIT:
        if _next_signal(w, PERIOD_MS) == _QUIT:
            break
        if w.running[0] != block or w.running[1] != tick:
            block, tick, since, starved = w.running[0], w.running[1], _now(w), _starved(w)
        silence, limit = _now(w) - since, w.idle_limit if block == IDLE else w.limit
        if silence > EXTENSION * limit or silence - (_starved(w) - starved) > limit:
            _report(w, number)
            call_int(w.exit, (128 + number,))
    return 0
