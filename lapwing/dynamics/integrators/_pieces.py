"""Systems whose forces change at known times: between two of these breakpoints a system is a smooth piece.

A step must end at a breakpoint, and its last stage must use the forces before the breakpoint.
"""

import math
from typing import Any, NamedTuple

from numba import types

from lapwing.dynamics.integrators._fixed_step import RATES, _rate
from lapwing.kernels import DispatchTable, always_inline, kernel
from lapwing.kernels.codegen import generic

BREAKPOINTS = DispatchTable()
"""The compiled `next_breakpoint(p, t)` of a system, by the NamedTuple class of its parameters; others have none."""

ROUNDING = 1e-6  # relative to an interval: breakpoints this close to its ends count as the ends
BEFORE = 1.0 - 2.0**-52  # factor from a positive number to a smaller double


class Piece(NamedTuple):
    """A system between two breakpoints."""

    system: Any  # parameters, a class of RATES
    first: float  # [s] start of the piece; earlier times count as this one
    last: float  # [s] end of the piece; later times count as this one


@kernel
def _rate_of_piece(p, t, x):
    return _rate(p.system, min(max(t, p.first), p.last), x)


RATES[Piece] = _rate_of_piece


@generic(inline=True)
def next_breakpoint(p: types.Type, t: types.Type) -> Any:
    """Return the first time [s] after t at which the forces of the system p change; infinity if there is none."""
    return BREAKPOINTS.get(p.instance_class, lambda p, t: math.inf)


@always_inline
def piece(p, start, end):
    """Return (first piece of the interval from `start` to `end` [s], its end [s])."""
    rounding = ROUNDING * (end - start)
    first = next_breakpoint(p, start)
    if first > start + rounding:
        first = start
    until = next_breakpoint(p, max(first, start + rounding))
    return Piece(p, first, BEFORE * until), until if until < end - rounding else end
