"""Forward Euler in the embedding: the stored numbers are stepped as if space were flat, and drift off the manifold."""

from lapwing.dynamics.integrators._fixed_step import method_token
from lapwing.kernels import always_inline
from lapwing.kernels.state_tree import axpy, embed

ORDER = 1
EVALUATIONS = 1
ON_MANIFOLD = False
Method = method_token(__name__)


@always_inline
def step(rate, p, t, x, h):
    """Return x + h x' (theory, eq. (6.1))."""
    return axpy(h, embed(x, rate(p, t, x)), x)
