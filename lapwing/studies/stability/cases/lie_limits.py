"""Case 4: closed forms on SO(3) at their removable singularities."""

import math
from decimal import Decimal, localcontext

import numpy as np

from lapwing.dynamics.lie import ratios, so3
from lapwing.kernels import python_function
from lapwing.studies.stability.case_result import CaseResult, Curve, Plot, Row

HARD = "the inverse of dexp at angles near 0 and near its pole at 2 pi; the logarithm of rotations by nearly pi"

BOUND = 1e-14
WHY = "fifty units in the last place: only the round-off of the operations"
AXIS = np.array([2.0, -3.0, 6.0]) / 7.0
DIGITS = 60


def series(x: Decimal, first: Decimal, k: int) -> Decimal:
    """Return the sine (first = x, k = 1) or cosine (first = 1, k = 0) by its power series."""
    total, term = first, first
    while abs(term) > Decimal(10) ** -DIGITS:
        term *= -x * x / ((k + 1) * (k + 2))
        k += 2
        total += term
    return total


def exact(v: tuple[float, ...]) -> float:
    """Return (1 - (a/2) cot(a/2)) / a^2 with a = |v|, exact for these floats."""
    with localcontext() as context:
        context.prec = DIGITS
        square = sum((Decimal(c) * Decimal(c) for c in v), Decimal(0))
        half = square.sqrt() / 2
        return float((1 - half * series(half, Decimal(1), 0) / series(half, half, 1)) / square)


def baseline_ratio(v: tuple[float, ...]) -> float:
    """Return the ratio of `exact` by the textbook formula (baseline)."""
    a = np.float64(np.linalg.norm(v))
    with np.errstate(all="ignore"):
        return float((1.0 - 0.5 * a / np.tan(0.5 * a)) / (a * a))


def baseline_log(m: np.ndarray) -> np.ndarray:
    """Return the logarithm by the textbook formula: angle from the arc cosine, axis from the skew part (baseline)."""
    R = m.reshape(3, 3)
    with np.errstate(all="ignore"):
        angle = np.arccos(np.clip(0.5 * (np.trace(R) - 1.0), -1.0, 1.0))
        skew = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
        return 0.5 * angle / np.sin(angle) * skew


def ratio_errors(angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the relative errors of Lapwing's and of the baseline ratio at angles [rad], shape (k,) each."""
    vectors = [tuple(float(c) for c in a * AXIS) for a in angles]
    true = np.array([exact(v) for v in vectors])
    ours, baseline = (
        np.array([f(v) for v in vectors]) for f in (python_function(ratios.cotangent_ratio), baseline_ratio)
    )
    return np.abs(ours / true - 1.0), np.abs(baseline / true - 1.0)


def log_errors(gaps: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the errors [rad] of Lapwing's and of the baseline logarithm, shape (k,) each.

    The rotations are by pi minus `gaps` [rad], shape (k,).
    """
    vectors = [(math.pi - gap) * AXIS for gap in gaps]
    matrices = [np.array(so3.exp(tuple(float(c) for c in v))) for v in vectors]
    ours = [np.abs(np.array(so3.log(tuple(m.tolist()))) - v).max() for m, v in zip(matrices, vectors, strict=True)]
    baseline = [np.abs(baseline_log(m) - v).max() for m, v in zip(matrices, vectors, strict=True)]
    return np.array(ours), np.array(baseline)


def run() -> CaseResult:
    """Measure the three limits."""
    gaps = np.geomspace(1e-1, 1e-9, 33)
    small, at_pole, at_pi = ratio_errors(gaps), ratio_errors(2.0 * math.pi - gaps), log_errors(gaps)
    invariant = "error of the third coefficient of the inverse of dexp, relative"
    rows = [
        Row("dexpinv_at_zero", "series below 1 rad", invariant, BOUND, WHY, float(small[0].max()),
            "(1 - (a/2) cot(a/2)) / a^2", float(small[1].max())),
        Row("dexpinv_at_2_pi", "vector length in double-double precision", invariant, BOUND, WHY,
            float(at_pole[0].max()), "(1 - (a/2) cot(a/2)) / a^2", float(at_pole[1].max())),
        Row("log_at_pi", "from the largest component of the quaternion", "error of the rotation vector [rad]", BOUND,
            WHY, float(at_pi[0].max()), "arc cosine of the trace, skew part", float(at_pi[1].max())),
    ]  # fmt: skip
    curves = [
        Curve(f"{name}{where}", gaps, np.maximum(values, 1e-17))
        for where, both in ((" at 0", small), (" at 2 pi", at_pole), (" log at pi", at_pi))
        for name, values in zip(("ours", "baseline"), both, strict=True)
    ]
    return CaseResult(rows, Plot("distance from the singular angle [rad]", "error", curves, BOUND, log_x=True))
