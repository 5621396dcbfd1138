"""Block that counts its steps, finishes at one tick and fails at another."""

from typing import NamedTuple

from lapwing.cosim.diagram.compiled_block import CONTINUE, FINISHED, NON_FINITE
from lapwing.kernels import always_inline


class Counter(NamedTuple):
    """Ticks at which the block finishes and fails."""

    last: int  # tick
    fails: int = 10_000  # tick


@always_inline
def step(p, s, tick, inputs):
    """Return the number of earlier steps."""
    return s + 1, (s,), NON_FINITE if tick == p.fails else FINISHED if tick >= p.last else CONTINUE
