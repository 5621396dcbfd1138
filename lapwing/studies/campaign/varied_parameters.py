"""Parameters of a campaign that differ between its runs, for plots."""

from collections.abc import Iterator

import numpy as np

from lapwing.studies.campaign.results import Results
from lapwing.studies.campaign.statistics import rank_correlation
from lapwing.studies.report.plot import NotRecordedError

BINS = 10  # intervals of a parameter
MAX_KEYS = 9  # parameters with a panel
TARGETS = ("max_distance", "touchdown.speed", "energy")  # metrics for sensitivities, in addition to success


def varied_parameters(results: Results) -> list[str]:
    """Return the parameters that differ between the runs."""
    keys = [key for key in results.folder.plan.keys if len(np.unique(results[key])) > 1]
    if not keys:
        raise NotRecordedError("no parameter varies; use --vary KEY=DISTRIBUTION")
    return keys


def strongest_parameters(results: Results) -> tuple[list[str], str]:
    """Return the at most `MAX_KEYS` parameters with the strongest correlations, and a text on the omitted ones."""
    keys = varied_parameters(results)
    if len(keys) <= MAX_KEYS:
        return keys, ""
    targets = [
        results[name].astype(float) for name in ("success", *TARGETS) if name == "success" or name in results.figures
    ]

    def strength(key: str) -> float:
        x = results.number(key)
        every = (
            abs(rank_correlation(x[is_finite], y[is_finite]).value)
            for y in targets
            if (is_finite := np.isfinite(y)).any()
        )
        return max((value for value in every if np.isfinite(value)), default=0.0)

    selected = set(sorted(keys, key=strength, reverse=True)[:MAX_KEYS])
    omitted = [key for key in keys if key not in selected]
    return [
        key for key in keys if key in selected
    ], f" Omitted, because their correlations are weakest: {', '.join(omitted)}."


def bins(x: np.ndarray) -> Iterator[np.ndarray]:
    """Yield a mask of the runs, shape (n,), for each value of a parameter or each interval with equal counts."""
    values = np.unique(x)
    if len(values) <= BINS:
        yield from (x == value for value in values)
        return
    edges = np.quantile(x, np.linspace(0.0, 1.0, BINS + 1))
    position = np.searchsorted(edges[1:-1], x, side="right")
    yield from (position == k for k in np.unique(position))


def with_unit(results: Results, key: str) -> str:
    """Return a parameter's key with its unit if known."""
    unit = results.units.get(key, "")
    return f"{key} [{unit}]" if unit else key


def texts_of(results: Results, name: str) -> tuple[str, ...]:
    """Return the values of a text parameter in the order of their indices; () for numbers."""
    return tuple(np.unique(results[name])) if results[name].dtype == object else ()
