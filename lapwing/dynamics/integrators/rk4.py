"""The classical Runge-Kutta method in the embedding: attitudes drift off SO(3) with the fifth power of the step."""

from lapwing.dynamics.integrators._fixed_step import method_token
from lapwing.kernels import always_inline
from lapwing.kernels.state_tree import axpy, embed, scale

ORDER = 4
EVALUATIONS = 4
ON_MANIFOLD = False
Method = method_token(__name__)


@always_inline
def increment(rate, p, t, x, h):
    """Return what a step adds to the stored numbers: the classical tableau (theory, eq. (6.3))."""
    half = 0.5 * h
    k1 = embed(x, rate(p, t, x))
    x2 = axpy(half, k1, x)
    k2 = embed(x2, rate(p, t + half, x2))
    x3 = axpy(half, k2, x)
    k3 = embed(x3, rate(p, t + half, x3))
    x4 = axpy(h, k3, x)
    k4 = embed(x4, rate(p, t + h, x4))
    return scale(h / 6.0, axpy(2.0, axpy(1.0, k2, k3), axpy(1.0, k1, k4)))


@always_inline
def step(rate, p, t, x, h):
    """Take a step of the classical tableau on the stored numbers."""
    return axpy(1.0, increment(rate, p, t, x, h), x)
