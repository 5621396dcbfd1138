"""Commutator-free method of order 4: two exponentials in the last stage instead of brackets.

Celledoni, Marthinsen, Owren, Future Gener. Comput. Syst. 19 (2003) 341.
"""

from lapwing.dynamics.integrators._fixed_step import method_token
from lapwing.kernels import always_inline
from lapwing.kernels.state_tree import axpy, retract, scale

ORDER = 4
EVALUATIONS = 4
ON_MANIFOLD = True
Method = method_token(__name__)


@always_inline
def step(rate, p, t, x, h):
    """Take a step of four stages and five exponentials, with x exp(k1/2) used twice (theory, eq. (6.10))."""
    half = 0.5 * h
    k1 = scale(h, rate(p, t, x))
    x2 = retract(x, scale(0.5, k1))
    k2 = scale(h, rate(p, t + half, x2))
    k3 = scale(h, rate(p, t + half, retract(x, scale(0.5, k2))))
    k4 = scale(h, rate(p, t + h, retract(x2, axpy(-0.5, k1, k3))))
    middle = scale(1.0 / 6.0, axpy(1.0, k2, k3))
    first = axpy(0.25, k1, axpy(-1.0 / 12.0, k4, middle))
    second = axpy(-1.0 / 12.0, k1, axpy(0.25, k4, middle))
    return retract(retract(x, first), second)
