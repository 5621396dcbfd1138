"""Clocks that jump, in one process of a run: a copy of this file named sitecustomize.py on the path installs them."""

import sys
import time
from collections.abc import Callable

HOUR, AHEAD = 3600, 1  # [s] error of the wall clock; jump of a monotonic clock
WALL_INTERVAL = 0.05  # [s] between two jumps of the wall clock
MONOTONIC_INTERVAL = 0.5  # [s] between two jumps of a monotonic clock; leaves a start 40 s of its limit of two minutes
VICTIM = "autopilot"


def wall(seconds: float) -> int:
    """Return the error of the wall clock [s] at a time [s]: alternately an hour late and an hour early."""
    return HOUR if int(seconds / WALL_INTERVAL) % 2 else -HOUR


def forward(seconds: float) -> int:
    """Return the jump of a monotonic clock at that time [s]."""
    return AHEAD * int(seconds / MONOTONIC_INTERVAL)


def add_jumps(clock: Callable[[], float], scale: int, jump: Callable[[float], int]) -> Callable[[], float]:
    """Return the clock with these jumps [s]; `scale` is its number of units per second."""

    def read() -> float:
        now = clock()
        return now + scale * jump(now / scale)

    return read


def install() -> None:
    """Replace the clocks of this process by jumping ones."""
    for name, jump in (("time", wall), ("monotonic", forward), ("perf_counter", forward)):
        for function, scale in ((name, 1), (f"{name}_ns", 10**9)):
            setattr(time, function, add_jumps(getattr(time, function), scale, jump))


if __name__ == "sitecustomize" and sys.orig_argv[-1] == VICTIM:
    install()
