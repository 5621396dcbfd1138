"""Block that returns its input and whether it was due."""

from typing import Any, NamedTuple

from lapwing.cosim.diagram.compiled_block import CONTINUE
from lapwing.kernels import always_inline


class Echo(NamedTuple):
    """Parameter, copied to the output."""

    sign: float


class Heard(NamedTuple):
    """Sample received at a tick."""

    due: bool
    value: Any
    sign: float


@always_inline
def step(p, s, tick, inputs):
    """Return the sample of the input."""
    r = inputs[0]
    return s, (Heard(r.due, r.value, p.sign),), CONTINUE
