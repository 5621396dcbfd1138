"""A part that gives what it has received, and whether that was due."""

from typing import Any, NamedTuple

from lapwing.cosim.diagram.compiled_block import CONTINUE
from lapwing.kernels import always_inline


class Echo(NamedTuple):
    """A part of one input."""

    sign: float


class Heard(NamedTuple):
    """Samples received at a tick."""

    due: bool
    value: Any
    sign: float


@always_inline
def step(p, s, tick, inputs):
    """Give the input's message on."""
    r = inputs[0]
    return s, (Heard(r.due, r.value, p.sign),), CONTINUE
