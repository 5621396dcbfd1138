"""Block that changes an array in place."""

from typing import NamedTuple

import numpy as np

from lapwing.cosim.diagram.compiled_block import CONTINUE
from lapwing.kernels import always_inline, kernel, noinline


class Mean(NamedTuple):
    """Weights of the sum of the last ticks."""

    weights: np.ndarray  # (n,)


class Last(NamedTuple):
    """Last ticks and number of steps."""

    ticks: np.ndarray  # (n,)
    count: int


class Sum(NamedTuple):
    """Output of the block."""

    number: float


@noinline
def _weighted(p, s):
    total = 0.0
    for i in range(len(p.weights)):
        total += p.weights[i] * s.ticks[i]
    return total, s


@always_inline
def step(p, s, tick, inputs):
    """Store the tick and return the weighted sum."""
    s.ticks[tick % len(s.ticks)] = tick
    total, s = _weighted(p, s)
    return Last(s.ticks, s.count + 1), (Sum(total),), CONTINUE


@kernel
def weighted(p, s):
    """Return the sum and the state to Python, from a function that the block calls, too."""
    return _weighted(p, s)
