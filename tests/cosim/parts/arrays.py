"""Parts with arrays: one that changes them in place, and one that makes new ones."""

from typing import NamedTuple

import numpy as np

from lapwing.cosim.diagram.compiled_block import CONTINUE
from lapwing.kernels import always_inline, kernel, noinline


class Mean(NamedTuple):
    """The weighted sum of the last ticks."""

    weights: np.ndarray  # (n,)


class Last(NamedTuple):
    """The last ticks, and how often they were written."""

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
    """The sum, the tick taken in."""
    s.ticks[tick % len(s.ticks)] = tick
    total, s = _weighted(p, s)
    return Last(s.ticks, s.count + 1), (Sum(total),), CONTINUE


@kernel
def weighted(p, s):
    """The sum and the state, for Python: by a function that parts call, too."""
    return _weighted(p, s)
