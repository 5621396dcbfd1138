"""Two campaigns beside each other, run by run: runs of one number and seed differ in nothing but what was changed."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from rich.console import Console
from rich.table import Table

from lapwing.studies.campaign.campaign_plots import label_and_factor
from lapwing.studies.campaign.folder import read
from lapwing.studies.campaign.results import Results
from lapwing.studies.campaign.statistics import Interval, interval, paired_difference
from lapwing.studies.metrics import METRICS

COMPARED = ("scene", "overrides", "vary", "sweep", "design", "versions")  # of a campaign's manifest


class Difference(NamedTuple):
    """A figure in both campaigns, and by how much the second has more of it."""

    figure: str
    one: float  # mean
    other: float
    difference: Interval  # of the means, over pairs of runs

    @property
    def sure(self) -> bool:
        """True if the interval excludes 0."""
        return self.difference.low > 0.0 or self.difference.high < 0.0


class Comparison(NamedTuple):
    """Two campaigns, paired."""

    names: tuple[str, str]
    differing: list[str]  # entries of their plans, and keys that pairs have drawn otherwise
    pairs: int
    left_out: int  # runs that only one has, or that one refuses
    failures: tuple[Interval, Interval]
    only_one: int  # pairs of which only the first fails
    only_other: int
    differences: list[Difference]  # "success" first


def compare(one: Path, other: Path) -> Comparison:
    """Compare two campaigns over their common runs.

    Raises:
        ValueError: one folder is no campaign, or they have no runs in common.
    """
    a, b = Results(read(one)), Results(read(other))
    known = {pair: k for k, pair in enumerate(_pairs(a))}
    pairs = [(known[pair], k) for k, pair in enumerate(_pairs(b)) if pair in known]
    if not pairs:
        raise ValueError(f"{one} and {other}: have no run of the same seed; expected two campaigns of one --seed")
    at, of = np.array(pairs).T
    good, better = a["success"][at].astype(float), b["success"][of].astype(float)
    differences = [Difference("success", float(good.mean()), float(better.mean()), paired_difference(good, better))]
    for name in METRICS:
        if a.folder.kinds[name] is float:
            x, y = a[name][at], b[name][of]
            there = np.isfinite(x) & np.isfinite(y)
            if there.any():
                means = float(x[there].mean()), float(y[there].mean())
                differences.append(Difference(name, *means, paired_difference(x[there], y[there])))
    count = len(pairs)
    failures = interval(int(count - good.sum()), count), interval(int(count - better.sum()), count)
    worse, mended = int(((good == 1) & (better == 0)).sum()), int(((good == 0) & (better == 1)).sum())
    total = len(set(_pairs(a)) | set(_pairs(b)))
    keys = [key for key in a.folder.plan.keys if key in b.folder.plan.keys]
    drawn = [f"{key} (drawn otherwise)" for key in keys if not np.array_equal(a[key][at], b[key][of])]
    differing = [name for name in COMPARED if a.folder.about[name] != b.folder.about[name]] + drawn
    return Comparison((str(one), str(other)), differing, count, total - count, failures, mended, worse, differences)


def _pairs(results: Results) -> list[tuple[int, int]]:
    return list(zip(results["run"].tolist(), results["seed"].tolist(), strict=True))


def show(console: Console, comparison: Comparison) -> None:
    """Print the comparison."""
    left_out = f", {comparison.left_out} left out that only one has flown" if comparison.left_out else ""
    console.print(f"{comparison.pairs} pairs of runs{left_out}")
    console.print(f"the campaigns differ in: {', '.join(comparison.differing) or 'nothing'}")
    for name, p in zip(comparison.names, comparison.failures, strict=True):
        console.print(f"  {name}: failures {p.value:.2%}, 95 % interval {p.low:.2%} to {p.high:.2%}")
    console.print(f"  failed in the first only: {comparison.only_one}, in the second only: {comparison.only_other}")
    title = "Means, and the change from the first to the second with its 95 % interval"
    table = Table(title=title, title_justify="left", box=None, pad_edge=False)
    table.add_column("figure", no_wrap=True)
    for head in ("first", "second", "change", "from", "to"):
        table.add_column(head, justify="right", no_wrap=True)
    for d in comparison.differences:
        label, scale = ("success [%]", 100.0) if d.figure == "success" else label_and_factor(d.figure)
        means = (f"{scale * mean:.4g}" for mean in (d.one, d.other))
        changes = (f"{scale * change:+.3g}" for change in d.difference)
        table.add_row(f"{label}{' *' if d.sure else ''}", *means, *changes)
    console.print(table)
    console.print("*: the interval does not hold 0")
