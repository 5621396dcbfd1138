"""Runge-Kutta-Munthe-Kaas of order 5 with an embedded order 4: the tableau of Dormand and Prince in the Lie algebra.

`step` is one fixed step; `stages` and `between` give what the adaptive run in `_adaptive` needs.
"""

from lapwing.dynamics.integrators._fixed_step import method_token
from lapwing.kernels import always_inline
from lapwing.kernels.state_tree import axpy, bracket, retract, scale

ORDER = 5
EVALUATIONS = 7
ON_MANIFOLD = True
Method = method_token(__name__)


@always_inline
def _dexpinv(x, u, k):
    """Return dexpinv(u, k) to the order of the method: k - [u, k]/2 + [u, [u, k]]/12 (theory, eq. (5.4))."""
    b = bracket(x, u, k)
    return axpy(1.0 / 12.0, bracket(x, u, b), axpy(-0.5, b, k))


@always_inline
def stages(rate, p, t, x, h, k1):
    """Return (end, u, e, k, last): state at t + h, step u in the algebra and its error e (theory, eq. (6.9)).

    k is the tuple of pulled-back stages 1, 3, 4, 5, 6, 7 and last = h f(t + h, end). The argument k1 = h f(t, x) is
    `last` of the previous step.
    """
    u = scale(1 / 5, k1)
    k2 = _dexpinv(x, u, scale(h, rate(p, t + h / 5, retract(x, u))))
    u = axpy(9 / 40, k2, scale(3 / 40, k1))
    k3 = _dexpinv(x, u, scale(h, rate(p, t + 3 * h / 10, retract(x, u))))
    u = axpy(32 / 9, k3, axpy(-56 / 15, k2, scale(44 / 45, k1)))
    k4 = _dexpinv(x, u, scale(h, rate(p, t + 4 * h / 5, retract(x, u))))
    u = axpy(-212 / 729, k4, axpy(64448 / 6561, k3, axpy(-25360 / 2187, k2, scale(19372 / 6561, k1))))
    k5 = _dexpinv(x, u, scale(h, rate(p, t + 8 * h / 9, retract(x, u))))
    u = axpy(-5103 / 18656, k5, axpy(49 / 176, k4, axpy(46732 / 5247, k3, axpy(-355 / 33, k2, scale(9017 / 3168, k1)))))
    k6 = _dexpinv(x, u, scale(h, rate(p, t + h, retract(x, u))))
    u = axpy(11 / 84, k6, axpy(-2187 / 6784, k5, axpy(125 / 192, k4, axpy(500 / 1113, k3, scale(35 / 384, k1)))))
    end = retract(x, u)
    last = scale(h, rate(p, t + h, end))
    k7 = _dexpinv(x, u, last)
    e = axpy(-17253 / 339200, k5, axpy(71 / 1920, k4, axpy(-71 / 16695, k3, scale(71 / 57600, k1))))
    e = axpy(-1 / 40, k7, axpy(22 / 525, k6, e))
    return end, u, e, (k1, k3, k4, k5, k6, k7), last


@always_inline
def between(x, u, k, s):
    """Return the state at the fraction s of the step from x by u with stages k, of fourth order (eq. (6.14))."""
    k1, k3, k4, k5, k6, k7 = k
    bend = axpy(-1.0, u, k1)
    twist = axpy(-1.0, bend, axpy(-1.0, k7, u))
    rest = axpy(87487479700 / 32700410799, k3, scale(-12715105075 / 11282082432, k1))
    rest = axpy(701980252875 / 199316789632, k5, axpy(-10690763975 / 1880347072, k4, rest))
    rest = axpy(69997945 / 29380423, k7, axpy(-1453857185 / 822651844, k6, rest))
    r = 1.0 - s
    return retract(x, scale(s, axpy(r, axpy(s, axpy(r, rest, twist), bend), u)))


@always_inline
def step(rate, p, t, x, h):
    """Take a step of order 5."""
    return stages(rate, p, t, x, h, scale(h, rate(p, t, x)))[0]
