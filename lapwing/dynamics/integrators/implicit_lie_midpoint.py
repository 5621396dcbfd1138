"""Implicit midpoint rule along the exponential: symmetric in time, so energies of reversible systems do not drift."""

import math

from lapwing.dynamics.integrators._fixed_step import method_token
from lapwing.kernels import always_inline
from lapwing.kernels.state_tree import axpy, largest, retract, scale

ORDER = 2
ON_MANIFOLD = True
Method = method_token(__name__)

ITERATIONS = 60


@always_inline
def step(rate, p, t, x, h):
    """Solve u = h f(t + h/2, x exp(u/2)). Return x exp(u) (theory, eq. (6.13)).

    Fixed-point iteration until u is constant to round-off; it contracts while h times the Lipschitz constant of f is
    below two. A larger step gives NaN, not a wrong state.
    """
    middle = t + 0.5 * h
    u = scale(h, rate(p, t, x))
    before, rounding = math.inf, 1e-15 * largest(x)  # relative to u: round-off of cancelling terms in f
    for _ in range(ITERATIONS):
        after = scale(h, rate(p, middle, retract(x, scale(0.5, u))))
        change, size = largest(axpy(-1.0, u, after)), largest(after)
        u = after
        # the last digits may fluctuate: also stop if a small change no longer decreases
        if change <= 2e-16 * size or (change <= 1e-13 * size + rounding and change >= before):
            return retract(x, u)
        before = change
    return retract(x, scale(math.nan, u))
