"""Time per call of the elementary functions beside those of the C library, and of SVML where numba finds it.

Calls one after another, each independent of the last, from compiled code; arguments of usual size.
"""

import math
import time
from typing import Any

import numpy as np
from numba import config, njit

from lapwing.kernels import math as functions

COUNT = 4096
REPEATS = 200
RANGES = {
    "sin": (-4.0, 4.0), "cos": (-4.0, 4.0), "tan": (-4.0, 4.0), "asin": (-1.0, 1.0), "acos": (-1.0, 1.0),
    "atan": (-3.0, 3.0), "exp": (-10.0, 1.0), "expm1": (-1.0, 1.0), "log": (0.01, 10.0), "log1p": (-0.5, 10.0),
    "sqrt": (0.0, 10.0), "cbrt": (-10.0, 10.0), "tanh": (-3.0, 3.0), "atan2": (-1.0, 1.0), "hypot": (-1.0, 1.0),
    "pow": (0.1, 3.0),
}  # fmt: skip
PAIRS = ("atan2", "hypot", "pow")


def _loop(function: Any, pairs: bool) -> Any:
    if pairs:

        @njit(error_model="numpy")
        def run(x, y):
            total = 0.0
            for i in range(x.size):
                total += function(x[i], y[i])
            return total
    else:

        @njit(error_model="numpy")
        def run(x):
            total = 0.0
            for i in range(x.size):
                total += function(x[i])
            return total

    return run


def nanoseconds(function: Any, arguments: list[np.ndarray]) -> float:
    """Return the least time per call [ns]."""
    run = _loop(function, len(arguments) == 2)
    run(*arguments)
    times = []
    for _ in range(REPEATS):
        start = time.perf_counter_ns()
        run(*arguments)
        times.append(time.perf_counter_ns() - start)
    return min(times) / COUNT


def library() -> str:
    """Return the name of the library that numba's `math` functions come from."""
    return "SVML" if config.USING_SVML else "C library"  # type: ignore[attr-defined]


def main() -> None:
    """Print a line for each function."""
    rng = np.random.default_rng(1)
    print(f"| function | own [ns] | {library()} [ns] |\n|---|---|---|")
    for name, (low, high) in RANGES.items():
        arguments = [rng.uniform(low, high, COUNT) for _ in range(2 if name in PAIRS else 1)]
        theirs = np.cbrt if name == "cbrt" else getattr(math, name)
        times = [nanoseconds(function, arguments) for function in (getattr(functions, name), theirs)]
        print(f"| {name} | {times[0]:.1f} | {times[1]:.1f} |")


if __name__ == "__main__":
    main()
