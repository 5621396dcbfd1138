"""Block that sums a port of one number; blocks may share the state."""

from typing import NamedTuple

from lapwing.cosim.diagram.compiled_block import CONTINUE
from lapwing.kernels import always_inline


class Number(NamedTuple):
    """Port of one number."""

    value: float


class RunningSum(NamedTuple):
    """Weight of the input."""

    weight: float


@always_inline
def step(p, s, tick, inputs):
    """Add a due sample."""
    s += p.weight * inputs[0].value.value if inputs[0].due else 0.0
    return s, (Number(s),), CONTINUE
