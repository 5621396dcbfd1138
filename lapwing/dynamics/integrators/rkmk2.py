"""Runge-Kutta-Munthe-Kaas of order 2: the explicit midpoint rule along the exponential; no bracket is needed."""

from lapwing.dynamics.integrators._fixed_step import method_token
from lapwing.kernels import always_inline
from lapwing.kernels.state_tree import retract, scale

ORDER = 2
EVALUATIONS = 2
ON_MANIFOLD = True
Method = method_token(__name__)


@always_inline
def step(rate, p, t, x, h):
    """Return x exp(h f(t + h/2, x exp(h f / 2))) (theory, eq. (6.6))."""
    middle = retract(x, scale(0.5 * h, rate(p, t, x)))
    return retract(x, scale(h, rate(p, t + 0.5 * h, middle)))
