"""Block that puts an array of its parameters into its state."""

from typing import NamedTuple

import numpy as np

from lapwing.cosim.diagram.compiled_block import CONTINUE
from lapwing.kernels import always_inline
from tests.cosim.blocks.arrays import Last, Sum


class Exchange(NamedTuple):
    """Weights, which replace the array of the state."""

    weights: np.ndarray  # (n,)


@always_inline
def step(p, s, tick, inputs):
    """Return the first number of the state."""
    return Last(p.weights, s.count + 1), (Sum(s.ticks[0]),), CONTINUE
