"""Statistics of campaigns: intervals, distributions, sensitivities."""

from importlib.util import find_spec
from typing import NamedTuple

import numpy as np
from scipy import stats

CONFIDENCE = 0.95  # confidence level of every interval


class Interval(NamedTuple):
    """An estimate with its 95 % interval."""

    value: float
    low: float
    high: float

    @property
    def half_width(self) -> float:
        """Larger distance of an end of the interval from the estimate."""
        return max(self.high - self.value, self.value - self.low)


class Spread(NamedTuple):
    """Distribution of a metric over the runs."""

    median: float
    low: float  # 5 % quantile
    high: float  # 95 % quantile
    worst: float
    run: int  # run of the worst value


def interval(k: int, n: int) -> Interval:
    """Return the Clopper-Pearson interval of a probability from k events in n trials; it is conservative."""
    if n == 0:
        return Interval(float("nan"), 0.0, 1.0)
    result = stats.binomtest(k, n).proportion_ci(CONFIDENCE, method="exact")
    return Interval(k / n, float(result.low), float(result.high))


def spread(values: np.ndarray, runs: np.ndarray, least: bool = False) -> Spread | None:
    """Return the distribution of the finite values of a metric; None if empty.

    The worst value is the largest, with `least` the smallest.
    """
    is_finite = np.isfinite(values)
    if not is_finite.any():
        return None
    numbers, runs = values[is_finite], runs[is_finite]
    low, median, high = np.quantile(numbers, [0.05, 0.5, 0.95])
    worst = int(numbers.argmin() if least else numbers.argmax())
    return Spread(float(median), float(low), float(high), float(numbers[worst]), int(runs[worst]))


def paired_difference(a: np.ndarray, b: np.ndarray) -> Interval:
    """Return the mean of b - a over pairs, with Student's interval; NaN with fewer than two pairs."""
    difference = (b - a)[np.isfinite(a) & np.isfinite(b)]
    if len(difference) < 2:
        return Interval(float("nan"), float("nan"), float("nan"))
    mean, error = float(difference.mean()), float(stats.sem(difference))
    half_width = float(stats.t.ppf(0.5 + 0.5 * CONFIDENCE, len(difference) - 1)) * error
    return Interval(mean, mean - half_width, mean + half_width)


def rank_correlation(x: np.ndarray, y: np.ndarray) -> Interval:
    """Return Spearman's correlation of two columns (n,), with the interval of Fisher's transformation."""
    if len(x) < 4 or np.ptp(x) == 0.0 or np.ptp(y) == 0.0:
        return Interval(float("nan"), float("nan"), float("nan"))
    rho = float(stats.spearmanr(x, y).statistic)
    half_width = float(stats.norm.ppf(0.5 + 0.5 * CONFIDENCE)) * np.sqrt((1.0 + 0.5 * rho * rho) / (len(x) - 3.0))
    z = np.arctanh(np.clip(rho, -1.0 + 1e-12, 1.0 - 1e-12))
    return Interval(rho, float(np.tanh(z - half_width)), float(np.tanh(z + half_width)))


def has_sobol() -> bool:
    """Return True if SALib is installed."""
    return find_spec("SALib") is not None


def sobol(x: np.ndarray, y: np.ndarray, names: list[str]) -> list[Interval]:
    """Return first-order Sobol indices of the columns of x (n, k) for y (n,), from independent columns.

    NaN for a constant column. By SALib's RBD-FAST: Plischke, "An effective algorithm for computing global sensitivity
    indices (EASI)", 2010.
    """
    from SALib.analyze import rbd_fast

    low, high = x.min(axis=0), x.max(axis=0)
    varying = np.flatnonzero(high > low)
    bounds = np.column_stack([low, high])[varying].tolist()
    problem = {"num_vars": len(varying), "names": [names[k] for k in varying], "bounds": bounds}
    with np.errstate(invalid="ignore", divide="ignore"):  # a resample with equal results of all runs
        result = rbd_fast.analyze(problem, x[:, varying], y, seed=1, conf_level=CONFIDENCE)
    indices = [Interval(np.nan, np.nan, np.nan)] * len(names)
    for k, s, c in zip(varying, result["S1"], result["S1_conf"], strict=True):
        indices[k] = Interval(float(s), float(s - c), float(s + c))
    return indices


def ellipse(points: np.ndarray, share: float) -> np.ndarray:
    """Return the ellipse (90, 2) with this share of a normal distribution fitted to points (k, 2)."""
    values, axes = np.linalg.eigh(np.cov(points.T))
    radius = np.sqrt(stats.chi2.ppf(share, 2) * np.clip(values, 0.0, None))
    angle = np.linspace(0.0, 2.0 * np.pi, 90)
    return points.mean(axis=0) + (radius * np.column_stack([np.cos(angle), np.sin(angle)])) @ axes.T
