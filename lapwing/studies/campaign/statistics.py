"""Statistics of campaigns: intervals, distributions, sensitivities."""

import math
from typing import NamedTuple

import numpy as np
from scipy import stats

CONFIDENCE = 0.95  # confidence level of every interval
MANY_VALUES = 10  # values of a parameter above which it is split into intervals
RESAMPLES = 100  # resamples of a bootstrap


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


def _deviations(tests: int) -> float:
    """Return the half-width of a normal interval in standard deviations, if all of `tests` intervals are to hold."""
    return float(stats.norm.ppf(1.0 - 0.5 * (1.0 - CONFIDENCE) / tests))


def rank_correlation(x: np.ndarray, y: np.ndarray, tests: int = 1) -> Interval:
    """Return Spearman's correlation of two columns (n,), with the interval of Fisher's transformation.

    The intervals of `tests` parameters hold together (Bonferroni); so do those of `variance_share`.
    """
    if len(x) < 4 or np.ptp(x) == 0.0 or np.ptp(y) == 0.0:
        return Interval(float("nan"), float("nan"), float("nan"))
    rho = float(stats.spearmanr(x, y).statistic)
    half_width = _deviations(tests) * np.sqrt((1.0 + 0.5 * rho * rho) / (len(x) - 3.0))
    z = np.arctanh(np.clip(rho, -1.0 + 1e-12, 1.0 - 1e-12))
    return Interval(rho, float(np.tanh(z - half_width)), float(np.tanh(z + half_width)))


def groups(x: np.ndarray, count: int) -> np.ndarray:
    """Return the number of a group for each value of a parameter, shape (n,), counted from 0.

    Each of at most `MANY_VALUES` different values is a group; more values are split into `count` groups of equal size.
    """
    values, index = np.unique(x, return_inverse=True)
    if len(values) <= MANY_VALUES:
        return index
    edges = np.quantile(x, np.linspace(0.0, 1.0, count + 1))
    return np.unique(np.searchsorted(edges[1:-1], x, side="right"), return_inverse=True)[1]


def variance_share(x: np.ndarray, y: np.ndarray, tests: int = 1) -> Interval:
    """Return the share of the variance of y (n,) that the parameter x (n,) explains alone: its first-order Sobol index.

    Means of y in groups of x, without what chance contributes: epsilon squared of Kelley, "An unbiased correlation
    ratio measure", 1935. The interval is that of a bootstrap. NaN for a constant column.
    """
    n, index = len(x), groups(x, max(2, int(0.5 * np.sqrt(len(x))))) if len(x) else np.empty(0, int)
    count = int(index.max()) + 1 if n else 0
    if not 1 < count < n or np.ptp(y) == 0.0:
        return Interval(np.nan, np.nan, np.nan)
    centred = y - y.mean()

    def share(rows: np.ndarray) -> float:
        group, values = index[rows], centred[rows]
        size, total = np.bincount(group, minlength=count), np.bincount(group, values, count)
        between = float((total[size > 0] ** 2 / size[size > 0]).sum()) - values.sum() ** 2 / n
        whole = float((values - values.mean()) @ (values - values.mean()))
        if whole == 0.0:
            return np.nan
        return 1.0 - (whole - between) / (n - (size > 0).sum()) * (n - 1) / whole

    random = np.random.default_rng(1)
    value, deviation = share(np.arange(n)), np.nanstd([share(random.integers(0, n, n)) for _ in range(RESAMPLES)])
    half_width = _deviations(tests) * float(deviation)
    return Interval(value, value - half_width, value + half_width)


def ratio_change(a: np.ndarray, b: np.ndarray) -> Interval:
    """Return the relative change from a to b over pairs of positive values, by Student's interval of logarithms."""
    is_valid = (a > 0.0) & (b > 0.0)  # False for NaN
    log = paired_difference(np.log(a[is_valid]), np.log(b[is_valid]))
    return Interval(*(float(np.expm1(value)) for value in log))


def percent(p: Interval, signed: bool = False) -> str:
    """Return a share with its interval, in the digits that it allows: 75 % (95 % confidence interval 68 to 81)."""
    width = 100.0 * (p.high - p.low) / 2.0
    digits = min(max(0, math.ceil(-math.log10(width))), 9) if 0.0 < width < math.inf else 0
    value, low, high = (f"{100.0 * number:{'+' if signed else ''}.{digits}f}" for number in p)
    return f"{value} % (95 % confidence interval {low} to {high})"


def ellipse(points: np.ndarray, share: float) -> np.ndarray:
    """Return the ellipse (90, 2) with this share of a normal distribution fitted to points (k, 2)."""
    values, axes = np.linalg.eigh(np.cov(points.T))
    radius = np.sqrt(stats.chi2.ppf(share, 2) * np.clip(values, 0.0, None))
    angle = np.linspace(0.0, 2.0 * np.pi, 90)
    return points.mean(axis=0) + (radius * np.column_stack([np.cos(angle), np.sin(angle)])) @ axes.T
