"""Runs in real time: scheduling class of the operating system, and deadlines that each service missed.

A service is late at a tick when its own step takes longer than a tick; the clock owner is late when it cannot
begin a tick in time because the previous tick is not complete, whichever service caused it.
"""

import json
import os
from collections.abc import Mapping
from typing import NamedTuple

PRIORITY = 10  # SCHED_FIFO priority: above all ordinary programs, below the threads of the operating system's kernel


def unavailable_reason() -> str:
    """Return the reason why this process cannot use the real-time class; "" if it can."""
    if not hasattr(os, "sched_setscheduler"):
        return "this system has no real-time class"
    policy, priority = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
        os.sched_setscheduler(0, policy, priority)
    except OSError as error:
        reason = str(error.strerror).lower()
        return f"{reason}; it needs the capability CAP_SYS_NICE or a limit RLIMIT_RTPRIO of {PRIORITY}"
    return ""


def enter() -> None:
    """Put all threads of this process into the real-time class.

    Raises:
        OSError: it has no permission (see `unavailable_reason`).
    """
    for thread in os.listdir("/proc/self/task"):
        os.sched_setscheduler(int(thread), os.SCHED_FIFO, os.sched_param(PRIORITY))


MISSED, WORST = "missed_deadlines", "worst_lateness"  # keys of a log's metadata


class Lateness(NamedTuple):
    """Number of late ticks of a service in a run, and the largest delay."""

    ticks: int  # number of late ticks
    worst: float  # [s], 0 without a late tick


class Deadlines:
    """Counts the ticks at which one service was late."""

    def __init__(self) -> None:
        self._ticks, self._worst = 0, 0.0

    def note(self, late: float) -> None:
        """Count a tick that was finished `late` [s] after its time; negative if it was early."""
        if late > 0.0:
            self._ticks += 1
            self._worst = max(self._worst, late)

    def to_text(self) -> str:
        """Return the counts as text, which `lateness` parses."""
        return json.dumps(Lateness(self._ticks, self._worst))


def lateness(text: str) -> Lateness:
    """Parse the result of `Deadlines.to_text`.

    Raises:
        ValueError: the text is invalid.
    """
    try:
        ticks, worst = json.loads(text)
        return Lateness(int(ticks), float(worst))
    except TypeError as error:
        raise ValueError(f"not a lateness: {error}") from None


def metadata_entries(services: Mapping[str, Lateness]) -> dict[str, str]:
    """Return entries of a log's metadata from the lateness of each service; empty without reports."""
    if not services:
        return {}
    return {
        MISSED: ", ".join(f"{name} {late.ticks}" for name, late in sorted(services.items())),
        WORST: ", ".join(f"{name} {1e3 * late.worst:.2f} ms" for name, late in sorted(services.items())),
    }
