"""Processor core that a thread shares with a program which works in turn with it.

In lock step Lapwing waits while the firmware computes, and the firmware waits while Lapwing computes. On two cores each
message wakes a core that has just become idle. On a virtual machine, or on a core in a deep sleep state, that takes up
to ten times as long as a thread switch on one core, and the CPU time of a wake-up is charged to its sender. On one core
the two lose nothing, because they never compute at the same time. Only the thread that exchanges messages is bound to
the core; other threads of the process, such as that of the log, keep all cores.

Linux only; elsewhere, and where the system does not permit it, nothing is bound.
"""

import errno
import os
import socket
import sys
import threading
import time
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Self

from lapwing.cosim.processes.patience import PROCESSORS

PERIOD = 1.0  # [s] of wall time between two checks of the load
MARGIN = 0.3  # share of a core's time by which another core must be less loaded
PLACES = 64  # most claims on a core
_BUSY = (1, 2, 3, 6, 7, 8)  # words of a line of /proc/stat: user, nice, system, irq, softirq, steal


class CoreClaim:
    """Claim on a core, which other runs on this machine see.

    It is an abstract socket name. The system frees it with the last process that holds the socket.

    Attributes:
        core: number of the core.
    """

    def __init__(self, core: int, held: socket.socket | None):
        """Hold a socket that is bound to the name; None if the system has no such names."""
        self.core, self._held = core, held

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.release()

    def release(self) -> None:
        """Withdraw the claim."""
        if self._held:
            self._held.close()
        self._held = None


def claim_core(cores: Sequence[int]) -> CoreClaim:
    """Return a claim on the first of `cores` with the fewest claims."""
    for place in range(PLACES):
        for core in cores:
            held = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
            try:
                held.bind(f"\0lapwing-core-{core}-{place}")
            except OSError as error:
                held.close()
                if error.errno == errno.EADDRINUSE:
                    continue
                return CoreClaim(cores[0], None)
            return CoreClaim(core, held)
    return CoreClaim(cores[0], None)


def claim_any() -> CoreClaim | None:
    """Return a claim on a core that this thread may use, None on systems other than Linux."""
    cores = _allowed()
    return claim_core(cores) if cores else None


def cores_at_start(in_turns: bool) -> list[int]:
    """Return the cores on which a program begins, none if the system has no affinity.

    A program whose threads run in turns begins on one: on two, messages of its two sockets can change their order.
    """
    cores = _allowed()
    return cores[:1] if in_turns else cores


def less_loaded_core(core: int, own: float, loads: Mapping[int, float]) -> int | None:
    """Return the core to move to, None to stay.

    Args:
        core: present core.
        own: share of the time of `core` that the thread and its programs use, 0 to 1.
        loads: busy share of the time of each core that may be used, 0 to 1.
    """
    others = {each: load for each, load in loads.items() if each != core}
    if not others:
        return None
    best = min(others, key=others.__getitem__)
    return best if loads[core] - own > others[best] + MARGIN else None


def busy_times() -> dict[int, float]:
    """Return the time [s] since the start of the system in which each core was busy; empty if it is not known."""
    result = {}
    with suppress(OSError, IndexError, ValueError):
        for line in PROCESSORS.read_text().splitlines():
            words = line.split()
            if line.startswith("cpu") and words[0] != "cpu":
                result[int(words[0][3:])] = sum(int(words[k]) for k in _BUSY) / os.sysconf("SC_CLK_TCK")
    return result


def process_tree(thread: int) -> list[int]:
    """Return a thread and the processes started by it, and by the main threads of these processes.

    Args:
        thread: id of a thread; that of a main thread is its process id.

    Returns:
        Only the thread if the system does not list children.
    """
    result = [thread]
    for parent in result:
        with suppress(OSError):  # it has ended
            result += map(int, Path(f"/proc/{parent}/task/{parent}/children").read_text().split())
    return result


def total_cpu_time(pid: int) -> float:
    """Return the CPU time [s] of a process with its ended threads, 0 if the system does not report it.

    `patience.cpu_times` is finer, but a thread that ends takes its time along.
    """
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    except (OSError, IndexError, ValueError):
        return 0.0


class SharedCore:
    """Core of the calling thread and a program that it has started.

    All methods must be called by the thread that exchanges messages with the program. Create the object before the
    program starts. An affinity that the user gives to either, before or during the run, is respected.
    """

    def __init__(self) -> None:
        """Store the affinity of this thread."""
        self._initial = _affinity(0)
        self._core: int | None = None  # None: nothing is shared
        self._pid = 0
        self._claim: CoreClaim | None = None  # None: the thread was bound by others
        self._next = 0.0  # [s] of the next check

    def begin(self, pid: int, started: Collection[int]) -> None:
        """Share a core with a program that has `started` on these cores."""
        if len(self._initial) < 2 or _affinity(pid) != set(started):
            return
        allowed = _affinity(0)
        if len(allowed) == 1:  # the executor keeps all services on this core
            (self._core,) = allowed
        elif claim := claim_any():
            if not bind(0, {claim.core}):
                claim.release()
                return
            self._claim, self._core = claim, claim.core
        self._pid, self._next = pid, time.monotonic() + PERIOD
        self._measure()
        self._started = set(started)
        self._move_program(self._started)

    def update(self) -> None:
        """Leave the core if others use it and another core is free; bind new threads of the program.

        It checks once a second; call it more often.
        """
        if self._core is None or time.monotonic() < self._next:
            return
        self._next = time.monotonic() + PERIOD
        present, before = _affinity(0), {self._core}
        if len(present) != 1 or (self._claim and present != before):  # changed from outside
            self._forget()
            return
        (self._core,) = present  # the owner of the claim, another vehicle of this thread, may have moved
        if self._claim and len(self._started) > 1:  # while a program in turns moved, its messages could change order
            self._relocate()
        self._move_program(self._started, before)

    def end(self) -> None:
        """Give the thread its affinity back."""
        if self._claim and _affinity(0) == {self._core}:
            bind(0, self._initial)
        self._forget()

    def _relocate(self) -> None:
        """Bind the thread to a core with clearly less load, if there is one."""
        before, own_before, at = self._busy, self._own, self._at
        self._measure()
        elapsed = self._at - at
        loads = {
            core: (self._busy[core] - before[core]) / elapsed
            for core in self._initial
            if core in before and core in self._busy and elapsed > 0.0
        }
        if self._core not in loads:
            return
        better = less_loaded_core(self._core, (self._own - own_before) / elapsed, loads)
        if better is None or not bind(0, {better}):
            return
        assert self._claim is not None
        self._claim.release()
        self._claim, self._core = claim_core([better]), better
        self._measure()

    def _measure(self) -> None:
        """Store the busy times of the cores, and the CPU time of this thread and of all its programs."""
        self._busy, self._at = busy_times(), time.monotonic()
        self._own = time.thread_time() + sum(map(total_cpu_time, process_tree(threading.get_native_id())[1:]))

    def _move_program(self, *known: set[int]) -> None:
        """Bind the threads of the program to the core, except those whose affinity is not `known`."""
        assert self._core is not None
        for pid in process_tree(self._pid):
            for thread in _threads(pid):
                if _affinity(thread) in known:
                    bind(thread, {self._core})

    def _forget(self) -> None:
        if self._claim:
            self._claim.release()
        self._claim = self._core = None


def _allowed() -> list[int]:
    """Return the cores of this thread from any one on, because claims are not visible from another container."""
    cores = sorted(_affinity(0))
    first = os.getpid() % len(cores) if cores else 0
    return [*cores[first:], *cores[:first]]


def _affinity(thread: int) -> set[int]:
    """Return the cores of a thread, 0 for this one; none if it has ended or the system has no affinity."""
    if sys.platform == "linux":
        with suppress(OSError):
            return os.sched_getaffinity(thread)
    return set()


def bind(thread: int, cores: Iterable[int]) -> bool:
    """Set the cores of a thread. Return False if it has ended or the system does not permit it."""
    if sys.platform == "linux":
        with suppress(OSError):
            os.sched_setaffinity(thread, cores)
            return True
    return False


def _threads(pid: int) -> list[int]:
    """Return the threads of a process, none if it has ended."""
    with suppress(OSError):
        return [int(name) for name in os.listdir(f"/proc/{pid}/task")]
    return []
