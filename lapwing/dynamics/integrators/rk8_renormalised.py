"""Dormand and Prince's method of order 8 in the embedding, projected onto the manifold after every step.

For errors near round-off. Tableau: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, section II.10.
"""

from lapwing.dynamics.integrators._fixed_step import method_token
from lapwing.kernels import always_inline
from lapwing.kernels.state_tree import axpy, embed, normalise, scale

ORDER = 8
EVALUATIONS = 12
ON_MANIFOLD = True
Method = method_token(__name__)


@always_inline
def _slope(rate, p, t, x):
    return embed(x, rate(p, t, x))


@always_inline
def _slopes(rate, p, t, x, h):
    """Return the slopes with a weight of the twelve stages."""
    k1 = _slope(rate, p, t, x)
    y = axpy(0.05260015195876773 * h, k1, x)
    k2 = _slope(rate, p, t + 0.05260015195876773 * h, y)
    y = axpy(0.0197250569845379 * h, k1, x)
    y = axpy(0.0591751709536137 * h, k2, y)
    k3 = _slope(rate, p, t + 0.0789002279381516 * h, y)
    y = axpy(0.02958758547680685 * h, k1, x)
    y = axpy(0.08876275643042054 * h, k3, y)
    k4 = _slope(rate, p, t + 0.1183503419072274 * h, y)
    y = axpy(0.2413651341592667 * h, k1, x)
    y = axpy(-0.8845494793282861 * h, k3, y)
    y = axpy(0.924834003261792 * h, k4, y)
    k5 = _slope(rate, p, t + 0.2816496580927726 * h, y)
    y = axpy(0.037037037037037035 * h, k1, x)
    y = axpy(0.17082860872947386 * h, k4, y)
    y = axpy(0.12546768756682242 * h, k5, y)
    k6 = _slope(rate, p, t + 0.3333333333333333 * h, y)
    y = axpy(0.037109375 * h, k1, x)
    y = axpy(0.17025221101954405 * h, k4, y)
    y = axpy(0.06021653898045596 * h, k5, y)
    y = axpy(-0.017578125 * h, k6, y)
    k7 = _slope(rate, p, t + 0.25 * h, y)
    y = axpy(0.03709200011850479 * h, k1, x)
    y = axpy(0.17038392571223998 * h, k4, y)
    y = axpy(0.10726203044637328 * h, k5, y)
    y = axpy(-0.015319437748624402 * h, k6, y)
    y = axpy(0.008273789163814023 * h, k7, y)
    k8 = _slope(rate, p, t + 0.3076923076923077 * h, y)
    y = axpy(0.6241109587160757 * h, k1, x)
    y = axpy(-3.3608926294469414 * h, k4, y)
    y = axpy(-0.868219346841726 * h, k5, y)
    y = axpy(27.59209969944671 * h, k6, y)
    y = axpy(20.154067550477894 * h, k7, y)
    y = axpy(-43.48988418106996 * h, k8, y)
    k9 = _slope(rate, p, t + 0.6512820512820513 * h, y)
    y = axpy(0.47766253643826434 * h, k1, x)
    y = axpy(-2.4881146199716677 * h, k4, y)
    y = axpy(-0.590290826836843 * h, k5, y)
    y = axpy(21.230051448181193 * h, k6, y)
    y = axpy(15.279233632882423 * h, k7, y)
    y = axpy(-33.28821096898486 * h, k8, y)
    y = axpy(-0.020331201708508627 * h, k9, y)
    k10 = _slope(rate, p, t + 0.6 * h, y)
    y = axpy(-0.9371424300859873 * h, k1, x)
    y = axpy(5.186372428844064 * h, k4, y)
    y = axpy(1.0914373489967295 * h, k5, y)
    y = axpy(-8.149787010746927 * h, k6, y)
    y = axpy(-18.52006565999696 * h, k7, y)
    y = axpy(22.739487099350505 * h, k8, y)
    y = axpy(2.4936055526796523 * h, k9, y)
    y = axpy(-3.0467644718982196 * h, k10, y)
    k11 = _slope(rate, p, t + 0.8571428571428571 * h, y)
    y = axpy(2.273310147516538 * h, k1, x)
    y = axpy(-10.53449546673725 * h, k4, y)
    y = axpy(-2.0008720582248625 * h, k5, y)
    y = axpy(-17.9589318631188 * h, k6, y)
    y = axpy(27.94888452941996 * h, k7, y)
    y = axpy(-2.8589982771350235 * h, k8, y)
    y = axpy(-8.87285693353063 * h, k9, y)
    y = axpy(12.360567175794303 * h, k10, y)
    y = axpy(0.6433927460157636 * h, k11, y)
    return k1, k6, k7, k8, k9, k10, k11, _slope(rate, p, t + h, y)


@always_inline
def _add(slopes, h, y):
    k1, k6, k7, k8, k9, k10, k11, k12 = slopes
    y = axpy(0.054293734116568765 * h, k1, y)
    y = axpy(4.450312892752409 * h, k6, y)
    y = axpy(1.8915178993145003 * h, k7, y)
    y = axpy(-5.801203960010585 * h, k8, y)
    y = axpy(0.3111643669578199 * h, k9, y)
    y = axpy(-0.1521609496625161 * h, k10, y)
    y = axpy(0.20136540080403034 * h, k11, y)
    return axpy(0.04471061572777259 * h, k12, y)


@always_inline
def increment(rate, p, t, x, h):
    """Return what a step adds to the stored numbers."""
    slopes = _slopes(rate, p, t, x, h)
    return _add(slopes, h, scale(0.0, slopes[0]))


@always_inline
def step(rate, p, t, x, h):
    """Take a step; the projection preserves the order (theory, eq. (6.4))."""
    return normalise(_add(_slopes(rate, p, t, x, h), h, x))
