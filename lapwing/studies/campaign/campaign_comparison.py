"""Paired comparison of two campaigns: runs with equal number and seed differ only by the changes of the plan."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from rich.console import Console

from lapwing.studies.campaign.campaign_plots import label_and_factor
from lapwing.studies.campaign.folder import read
from lapwing.studies.campaign.results import Results
from lapwing.studies.campaign.statistics import Interval, interval, paired_difference
from lapwing.studies.metrics import METRICS
from lapwing.studies.terminal import table

PLAN_ENTRIES = ("scene", "overrides", "vary", "sweep", "design", "versions")  # of a manifest; they define the flights


class Difference(NamedTuple):
    """Means of a metric in both campaigns, and their difference."""

    figure: str
    one: float  # mean
    other: float
    difference: Interval  # second minus first, over pairs of runs

    @property
    def is_significant(self) -> bool:
        """True if the interval excludes 0."""
        return self.difference.low > 0.0 or self.difference.high < 0.0


class Comparison(NamedTuple):
    """Result of a paired comparison of two campaigns."""

    names: tuple[str, str]
    differing: list[str]  # different entries of the plans, and keys with different drawn values
    pairs: int
    unpaired: int  # runs that only one campaign has or accepts
    failures: tuple[Interval, Interval]
    only_first: int  # pairs in which only the run of the first fails
    only_second: int  # pairs in which only the run of the second fails
    differences: list[Difference]  # "success" first


def compare(one: Path, other: Path) -> Comparison:
    """Compare two campaigns over their common runs.

    Raises:
        ValueError: a folder is not a campaign, or the campaigns have no common runs.
    """
    a, b = Results(read(one)), Results(read(other))
    positions = {pair: k for k, pair in enumerate(_pairs(a))}
    pairs = [(positions[pair], k) for k, pair in enumerate(_pairs(b)) if pair in positions]
    if not pairs:
        raise ValueError(f"{one} and {other}: no run has the same seed; expected two campaigns with equal --seed")
    rows_a, rows_b = np.array(pairs).T
    success_a, success_b = a["success"][rows_a].astype(float), b["success"][rows_b].astype(float)
    differences = [
        Difference("success", float(success_a.mean()), float(success_b.mean()), paired_difference(success_a, success_b))
    ]
    for name in METRICS:
        if a.folder.kinds[name] is float:
            x, y = a[name][rows_a], b[name][rows_b]
            is_finite = np.isfinite(x) & np.isfinite(y)
            if is_finite.any():
                means = float(x[is_finite].mean()), float(y[is_finite].mean())
                differences.append(Difference(name, *means, paired_difference(x[is_finite], y[is_finite])))
    count = len(pairs)
    failures = interval(int(count - success_a.sum()), count), interval(int(count - success_b.sum()), count)
    only_first, only_second = int((success_a < success_b).sum()), int((success_b < success_a).sum())
    total = len(set(_pairs(a)) | set(_pairs(b)))
    keys = [key for key in a.folder.plan.keys if key in b.folder.plan.keys]
    different_values = [
        f"{key} (different values)" for key in keys if not np.array_equal(a[key][rows_a], b[key][rows_b])
    ]
    differing = [name for name in PLAN_ENTRIES if a.folder.about[name] != b.folder.about[name]] + different_values
    return Comparison(
        (str(one), str(other)), differing, count, total - count, failures, only_first, only_second, differences
    )


def _pairs(results: Results) -> list[tuple[int, int]]:
    return list(zip(results["run"].tolist(), results["seed"].tolist(), strict=True))


def show(console: Console, comparison: Comparison) -> None:
    """Print the comparison."""
    unpaired = f", {comparison.unpaired} runs without a pair left out" if comparison.unpaired else ""
    console.print(f"{comparison.pairs} pairs of runs{unpaired}")
    console.print(f"differences: {', '.join(comparison.differing) or 'none'}")
    for name, p in zip(comparison.names, comparison.failures, strict=True):
        console.print(f"  {name}: failures {p.value:.2%}, 95 % interval {p.low:.2%} to {p.high:.2%}")
    console.print(f"  failed in the first only: {comparison.only_first}, in the second only: {comparison.only_second}")
    title = "Means, and change from the first to the second with its 95 % interval"
    rows = table("metric", "first", "second", "change", "from", "to", title=title, box=None, pad_edge=False)
    for d in comparison.differences:
        label, scale = ("success [%]", 100.0) if d.figure == "success" else label_and_factor(d.figure)
        means = (f"{scale * mean:.4g}" for mean in (d.one, d.other))
        changes = (f"{scale * change:+.3g}" for change in d.difference)
        rows.add_row(f"{label}{' *' if d.is_significant else ''}", *means, *changes)
    console.print(rows)
    console.print("*: the interval excludes 0")
