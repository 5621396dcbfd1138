"""Lie-Euler: forward Euler along the group exponential.

This is also the gyrostat paper's forward Euler on a manifold, fEulM: its retraction on SO(3) is the same exponential.
"""

from lapwing.dynamics.integrators._fixed_step import method_token
from lapwing.kernels import always_inline
from lapwing.kernels.state_tree import retract, scale

ORDER = 1
EVALUATIONS = 1
ON_MANIFOLD = True
Method = method_token(__name__)


@always_inline
def step(rate, p, t, x, h):
    """Return x exp(h f) (theory, eq. (6.2))."""
    return retract(x, scale(h, rate(p, t, x)))
