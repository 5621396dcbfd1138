"""Runge-Kutta-Munthe-Kaas of order 4: the classical tableau in the Lie algebra, with two brackets a step.

Munthe-Kaas, BIT 38 (1998) 92; the reduction to two brackets is that of Munthe-Kaas and Owren,
Phil. Trans. R. Soc. A 357 (1999) 957.
"""

from lapwing.dynamics.integrators._fixed_step import method_token
from lapwing.kernels import always_inline
from lapwing.kernels.state_tree import axpy, bracket, retract, scale

ORDER = 4
EVALUATIONS = 4
ON_MANIFOLD = True
Method = method_token(__name__)


@always_inline
def step(rate, p, t, x, h):
    """Take a step of four stages, each one exponential from x (theory, eq. (6.7))."""
    half = 0.5 * h
    k1 = scale(h, rate(p, t, x))
    k2 = scale(h, rate(p, t + half, retract(x, scale(0.5, k1))))
    k3 = scale(h, rate(p, t + half, retract(x, axpy(-0.125, bracket(x, k1, k2), scale(0.5, k2)))))
    k4 = scale(h, rate(p, t + h, retract(x, k3)))
    total = axpy(2.0, axpy(1.0, k2, k3), axpy(1.0, k1, k4))
    return retract(x, scale(1.0 / 6.0, axpy(-0.5, bracket(x, k1, k4), total)))
