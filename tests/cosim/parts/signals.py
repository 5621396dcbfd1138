"""A part that signals that Python is to have a say at one tick, and the end at another."""

from typing import NamedTuple

from cosim.part import END, GO_ON, LOOK
from dynamics.kernel import leaf


class Signals(NamedTuple):
    """When it signals what."""

    look: int  # tick
    last: int  # tick


@leaf
def step(p, s, tick, inputs):
    """It gives nothing."""
    return s, (), END if tick >= p.last else LOOK if tick == p.look else GO_ON
