"""Clocks that jump, in one process of a run: a copy of this file named sitecustomize.py on the path installs them."""

import sys
import time
from collections.abc import Callable

HOUR, AHEAD = 3600, 1  # [s] by which the wall clock is wrong, and by which a clock that only goes forward leaps
OFTEN, RARELY = (
    0.05,
    0.5,
)  # [s] between two jumps of either; the latter leaves a start 40 s of the two minutes it may take
VICTIM = "autopilot"


def wall(seconds: float) -> int:
    """Return the error of the wall clock [s] at a time [s]: alternately an hour late and an hour early."""
    return HOUR if int(seconds / OFTEN) % 2 else -HOUR


def forward(seconds: float) -> int:
    """Return the jump of a monotonic clock at that time [s]."""
    return AHEAD * int(seconds / RARELY)


def add_jumps(clock: Callable[[], float], scale: int, jump: Callable[[float], int]) -> Callable[[], float]:
    """Return the clock with these jumps; it counts `scale` per second."""

    def read() -> float:
        now = clock()
        return now + scale * jump(now / scale)

    return read


def install() -> None:
    """Let the clocks of this process jump."""
    for name, jump in (("time", wall), ("monotonic", forward), ("perf_counter", forward)):
        for of, scale in ((name, 1), (f"{name}_ns", 10**9)):
            setattr(time, of, add_jumps(getattr(time, of), scale, jump))


if __name__ == "sitecustomize" and sys.orig_argv[-1] == VICTIM:
    install()
