"""Block that allocates an array at every tick."""

from typing import NamedTuple

import numpy as np

from lapwing.cosim.diagram.compiled_block import CONTINUE
from lapwing.kernels import always_inline
from tests.cosim.blocks.arrays import Last, Sum


class Squares(NamedTuple):
    """Size of the array of squares."""

    size: int


@always_inline
def step(p, s, tick, inputs):
    """Return the sum of the squares."""
    squares = np.arange(p.size) ** 2.0
    return Last(squares, s.count + 1), (Sum(squares.sum()),), CONTINUE
