"""The gyrostat paper's explicit Runge-Kutta method on a manifold, eRK4M: stages are transported back to x and combined.

Of fourth order only by analogy: on a curved manifold it has order 3, because parallel transport differs from the
differential of the exponential by the curvature at second order (theory, eq. (6.12)).
"""

from lapwing.dynamics.integrators._fixed_step import method_token
from lapwing.kernels import always_inline
from lapwing.kernels.state_tree import axpy, retract, scale, transport

ORDER = 3
FLAT_ORDER = 4
EVALUATIONS = 4
ON_MANIFOLD = True
Method = method_token(__name__)


@always_inline
def step(rate, p, t, x, h):
    """Take a step of the classical tableau with retraction for addition, transport for comparison (eq. (6.11))."""
    half = 0.5 * h
    k1 = rate(p, t, x)
    u = scale(half, k1)
    k2 = transport(x, u, rate(p, t + half, retract(x, u)))
    u = scale(half, k2)
    k3 = transport(x, u, rate(p, t + half, retract(x, u)))
    u = scale(h, k3)
    k4 = transport(x, u, rate(p, t + h, retract(x, u)))
    return retract(x, scale(h / 6.0, axpy(2.0, axpy(1.0, k2, k3), axpy(1.0, k1, k4))))
