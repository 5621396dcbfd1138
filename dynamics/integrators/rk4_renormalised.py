"""The classical Runge-Kutta method in the embedding, brought back onto the manifold after every step."""

from dynamics.integrators import rk4
from dynamics.integrators._march import token
from dynamics.kernel import leaf
from dynamics.tree import normalise

ORDER = 4
EVALUATIONS = 4
ON_MANIFOLD = True
Method = token(__name__)


@leaf
def step(rate, p, t, x, h):
    """Step of `rk4`, then the nearest point of the manifold; the projection keeps the order (theory.md, eq. (6.4))."""
    return normalise(rk4.step(rate, p, t, x, h))
