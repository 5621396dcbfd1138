"""The classical Runge-Kutta method in the embedding, projected onto the manifold after every step."""

from lapwing.dynamics.integrators import rk4
from lapwing.dynamics.integrators._fixed_step import method_token
from lapwing.kernels import always_inline
from lapwing.kernels.state_tree import axpy, normalise

ORDER = 4
EVALUATIONS = 4
ON_MANIFOLD = True
Method = method_token(__name__)
increment = rk4.increment


@always_inline
def step(rate, p, t, x, h):
    """Take a step of `rk4` and project it onto the manifold; the projection keeps the order (theory, eq. (6.4))."""
    return normalise(axpy(1.0, increment(rate, p, t, x, h), x))
