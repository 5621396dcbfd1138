"""Verdict of a campaign: how many runs fail, by which criteria, and which parameter drives that."""

import re
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from lapwing.services.common.schemas.success_criteria import Success
from lapwing.studies.campaign.results import Results
from lapwing.studies.campaign.statistics import Interval, percent, rank_correlation, variance_share

MIN_RUNS, MAX_RUNS = 50, 10_000  # runs from which shares of the variance are computed
DRIVING = 0.1  # least share of the variance of a parameter that drives a metric
LISTED = 2  # driving parameters in the text
ANY = "success"  # subject where no criterion has a limit: the success itself
_LIMIT = re.compile(r"([\w.]+)\s*(?:<=?|>=?)\s*([-+\d.eE]+)")


class Criterion(NamedTuple):
    """An expression of `[success]`."""

    text: str
    failures: int  # number of runs that do not meet it
    metric: str = ""  # of an expression such as "rmse.x < 0.1"; otherwise ""
    limit: float = float("nan")


class Driver(NamedTuple):
    """Influence of a parameter on a metric."""

    key: str
    correlation: Interval  # Spearman's rank correlation
    share: Interval  # of the variance; NaN for few runs or dependent parameters

    @property
    def strength(self) -> float:
        """Absolute rank correlation, or the share of the variance if that is larger; 0 if unknown."""
        return float(np.nanmax([0.0, abs(self.correlation.value), self.share.value]))


def criteria(results: Results) -> list[Criterion]:
    """Return the criteria, those with most failures first."""
    texts = results.folder.about["success"]
    failed = [unmet(texts, outcome) for outcome in results["outcome_text"][~results["success"].astype(bool)]]
    rows = []
    for text in texts:
        match = _LIMIT.fullmatch(text.strip())
        limit = (match[1], float(match[2])) if match else ()
        rows.append(Criterion(text, sum(text in missed for missed in failed), *limit))
    return sorted(rows, key=lambda row: -row.failures)


def unmet(texts: Iterable[str], outcome: str) -> list[str]:
    """Return the criteria that a run of a campaign does not meet, from its outcome as `runs.row_of` writes it."""
    return [text for text in texts if f" not {text}, " in f"{outcome}, " or f" not {text}; " in outcome]


def varied_parameters(results: Results) -> list[str]:
    """Return the parameters that differ between the runs."""
    return [key for key in results.folder.plan.keys if len(np.unique(results[key])) > 1]


def drivers(results: Results, metric: str) -> list[Driver]:
    """Return the varied parameters, the strongest influence on a metric (or on "success") first."""
    y = results[metric].astype(float)
    finite = np.flatnonzero(np.isfinite(y))
    subset = finite[random_subset(len(finite), MAX_RUNS)]
    with_shares = len(subset) >= MIN_RUNS and not results.folder.plan.sweep  # parameters of a sweep may be dependent
    result = []
    for key in (keys := varied_parameters(results)):
        x = results.number(key)
        share = variance_share(x[subset], y[subset], len(keys)) if with_shares else Interval(np.nan, np.nan, np.nan)
        result.append(Driver(key, rank_correlation(x[finite], y[finite], len(keys)), share))
    return sorted(result, key=lambda driver: -driver.strength)


def random_subset(n: int, most: int) -> np.ndarray:
    """Return at most `most` random indices of n runs; regular indices could match the steps of a grid."""
    return np.arange(n) if n <= most else np.sort(np.random.default_rng(1).choice(n, most, replace=False))


def subject(results: Results) -> str:
    """Return the metric that decides: of the criterion with most failures, or nearest to its limit; or "success"."""
    rows = criteria(results)
    limited = [row for row in rows if row.metric in results.figures and np.isfinite(row.limit)]
    most = max((row.failures for row in rows), default=0)
    deciding = [row.metric for row in limited if row.failures == most] if most else [row.metric for row in limited]
    return next(iter(deciding), ANY)


def verdict(results: Results) -> str:
    """Return the verdict in one sentence."""
    n, failures = len(results), int((~results["success"].astype(bool)).sum())
    share = percent(results.failure)
    own = [row for row in criteria(results) if row.text not in Success().require or row.failures]
    text = f"{failures} of {n} runs fail, {share}"
    if own and failures:
        text += f": {', '.join(f'{row.failures} by {row.text}' for row in own)}"
    metric = subject(results)
    causes = [_cause(driver) for driver in drivers(results, metric)][:LISTED]
    if any(causes) and (metric != ANY or failures):
        text += f"; {metric} is driven by {' and '.join(filter(None, causes))}"
    return text


def _cause(driver: Driver) -> str:
    """Return a parameter with its influence; "" if chance explains it."""
    if np.isfinite(driver.share.value):
        strong = driver.share.low > 0.0 and driver.share.value >= DRIVING
        return f"{driver.key} ({driver.share.value:.1f} of the variance)" if strong else ""
    c = driver.correlation
    return f"{driver.key} (rank correlation {c.value:+.1f})" if c.low > 0.0 or c.high < 0.0 else ""
