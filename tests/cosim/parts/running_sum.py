"""A part that adds up a port of one number; parts of one state share it."""

from typing import NamedTuple

from lapwing.cosim.diagram.compiled_block import CONTINUE
from lapwing.kernels import always_inline


class Number(NamedTuple):
    """A port of one number."""

    value: float


class RunningSum(NamedTuple):
    """The weight of what is added."""

    weight: float


@always_inline
def step(p, s, tick, inputs):
    """Add the message that is due."""
    s += p.weight * inputs[0].value.value if inputs[0].due else 0.0
    return s, (Number(s),), CONTINUE
