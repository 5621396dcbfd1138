"""Runge-Kutta-Munthe-Kaas of order 3: Heun's tableau in the Lie algebra, with one bracket a step."""

from lapwing.dynamics.integrators._fixed_step import method_token
from lapwing.kernels import always_inline
from lapwing.kernels.state_tree import axpy, bracket, retract, scale

ORDER = 3
EVALUATIONS = 3
ON_MANIFOLD = True
Method = method_token(__name__)


@always_inline
def step(rate, p, t, x, h):
    """Take a step of three stages, with only the correction that the order needs (theory, eq. (6.8))."""
    k1 = scale(h, rate(p, t, x))
    k2 = scale(h, rate(p, t + h / 3.0, retract(x, scale(1.0 / 3.0, k1))))
    k3 = scale(h, rate(p, t + 2.0 * h / 3.0, retract(x, scale(2.0 / 3.0, k2))))
    return retract(x, scale(0.25, axpy(-1.0, bracket(x, k2, k3), axpy(3.0, k3, k1))))
