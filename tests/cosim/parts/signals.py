"""A part that signals that Python is to have a say at one tick, and the end at another."""

from typing import NamedTuple

from lapwing.cosim.diagram.compiled_block import CONTINUE, FINISHED, WAKE_PYTHON
from lapwing.kernels import always_inline


class Signals(NamedTuple):
    """Parameters: ticks and their statuses."""

    look: int  # tick
    last: int  # tick


@always_inline
def step(p, s, tick, inputs):
    """It gives nothing."""
    return s, (), FINISHED if tick >= p.last else WAKE_PYTHON if tick == p.look else CONTINUE
