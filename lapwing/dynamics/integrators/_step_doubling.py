"""Error control of any method by step doubling, for systems with discontinuous forces.

Steps end at the breakpoints of a system; contacts that begin and end shorten them.
"""

import math
from typing import Any, NamedTuple

from lapwing.dynamics.integrators._compensated import (
    INCREMENTS,
    CompensatedSummation,
    add,
    exact,
    is_compensated,
    rounded,
    value_of,
)
from lapwing.dynamics.integrators._fixed_step import rate, step
from lapwing.dynamics.integrators._pieces import piece
from lapwing.kernels import always_inline
from lapwing.kernels import noinline as never_inlined
from lapwing.kernels.codegen import generic
from lapwing.kernels.state_tree import finite, relative_difference

SHORTEST = 0.01  # [s] relative to the tolerance: shorter substeps are not split
LEAST_TOLERANCE = 1e-13  # below it round-off of the rates decides on the substeps


class StepDoubling(NamedTuple):
    """Method with the tolerance of a substep."""

    method: Any  # `Method()` of an integrator
    tolerance: float  # tolerance, relative to 1 + size


@always_inline
def shorter(substep, error, tolerance):
    """Return the next substep after one with too large an error (theory, eq. (2.33))."""
    return substep * min(max(0.1, 0.7 * math.sqrt(tolerance / error)), 0.3)


@generic(inline=True)
def _step(method, p, t, x, h):
    if not is_compensated(x):
        return lambda method, p, t, x, h: step(method, p, t, x, h)
    increment = INCREMENTS[method.instance_class]
    return lambda method, p, t, x, h: add(x, increment(rate, p, t, x.value, h))


@never_inlined
def _once(method, p, t, x, h):
    # not inlined: it has three call sites, and would be optimised again in every caller
    return _step(method, p, t, x, h)


@never_inlined
def integrate_step_doubling(how, p, t, x, h, end):
    """Return the state at time `end` by step doubling; the result of the halves is kept, none longer than h."""
    while True:
        smooth, until = piece(p, t, end)
        x = _smooth(how, smooth, t, x, h, until)
        if not until < end:
            return x
        t = until


@never_inlined
def _smooth(how, p, start, x, h, end):
    # Sums of states are compensated, and time counts from the start: at a jump of a force the shortest substeps
    # change a slow state by less than a unit in the last place, and would never leave the jump.
    allowed, substep = how.tolerance, 2.0 * h
    smallest = SHORTEST * allowed
    x, t, duration = exact(CompensatedSummation(), how.method, x), 0.0, end - start
    while True:
        left = duration - t
        substep = min(substep, 2.0 * h)
        last = substep > (1.0 - 1e-9) * left
        size = left if last else substep
        half = 0.5 * size
        whole = _once(how.method, p, start + t, x, size)
        y = _once(how.method, p, start + (t + half), _once(how.method, p, start + t, x, half), half)
        sound = finite(y)
        error = relative_difference(value_of(y), value_of(whole)) if sound else math.inf
        if error > allowed and size > smallest:
            substep = shorter(size, error, allowed)
            continue
        x = y
        if last or not sound:
            return rounded(x)
        t += size
        if error < allowed / 32.0:
            substep = 2.0 * size
