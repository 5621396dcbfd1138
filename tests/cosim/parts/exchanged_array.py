"""A part that puts an array of its parameters into its state."""

from typing import NamedTuple

import numpy as np

from lapwing.cosim.diagram.compiled_block import CONTINUE
from lapwing.kernels import always_inline
from tests.cosim.parts.arrays import Last, Sum


class Exchange(NamedTuple):
    """The weights, which become what is remembered."""

    weights: np.ndarray  # (n,)


@always_inline
def step(p, s, tick, inputs):
    """The first of what is remembered."""
    return Last(p.weights, s.count + 1), (Sum(s.ticks[0]),), CONTINUE
