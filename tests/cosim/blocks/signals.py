"""Block that wakes Python at one tick and finishes at another."""

from typing import NamedTuple

from lapwing.cosim.diagram.compiled_block import CONTINUE, FINISHED, WAKE_PYTHON
from lapwing.kernels import always_inline


class Signals(NamedTuple):
    """Ticks of the statuses."""

    look: int  # tick
    last: int  # tick


@always_inline
def step(p, s, tick, inputs):
    """Return no output."""
    return s, (), FINISHED if tick >= p.last else WAKE_PYTHON if tick == p.look else CONTINUE
