"""Results of `lapwing stability` as a table and as JSON."""

import math
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from lapwing.studies import json_file
from lapwing.studies.stability.case_runner import Result


def figure(value: float) -> str:
    """Format a number briefly."""
    return f"{value:.2g}" if math.isfinite(value) else str(value)


def verdict(passes: bool) -> str:
    """Return "pass" or "fail", as printed and in JSON."""
    return "pass" if passes else "fail"


def distance(bound: float, measured: float) -> str:
    """Return the ratio of bound to measured value; "" if undefined, "exact" for 0."""
    if bound == 0.0 or not math.isfinite(measured):
        return ""
    if measured == 0.0:
        return "exact"
    return f"{bound / measured:.3g} x" if measured > 0.1 * bound else f"{bound / measured:.1g} x"


COLUMNS = {  # name: share of the width; None: width of FIGURES
    "case": 3, "invariant": 6, "method": 5, "bound": None, "measured": None, "margin": None, "verdict": None,
    "baseline method": 5, "its result": None,
}  # fmt: skip
FIGURES = {"bound": 8, "measured": 8, "margin": 8, "verdict": 7, "its result": 13}  # letters


def table(console: Console, results: Sequence[Result]) -> None:
    """Print the difficulty and the rows of each case."""
    for k, result in enumerate(results):
        console.print(f"\n[bold]{result.case}[/bold]: {escape(result.hard)}", highlight=False)
        shown = Table(box=None, pad_edge=False, header_style="dim", show_header=k == 0, expand=True)
        for name, ratio in COLUMNS.items():
            width = FIGURES.get(name)
            right = name in FIGURES and name != "verdict"
            shown.add_column(name, justify="right" if right else "left", ratio=ratio, width=width, no_wrap=bool(width))
        for row in result.figures.rows:
            shown.add_row(
                row.name, escape(row.invariant), escape(row.method), figure(row.bound), figure(row.measured),
                distance(row.bound, row.measured), _colour(row.passes), escape(row.baseline),
                f"{figure(row.baseline_measured)} {_colour(row.baseline_passes, not row.baseline_passes)}",
            )  # fmt: skip
        console.print(shown)


def _colour(passes: bool, expected: bool | None = None) -> str:
    colour = "green" if (passes if expected is None else expected) else "red"
    return f"[{colour}]{verdict(passes)}[/{colour}]"


def sweeps(console: Console, results: Sequence[Result]) -> None:
    """Print the difficulty at which each method breaks."""
    for result in results:
        if result.sweep is None:
            continue
        console.print(
            f"\n[bold]{result.case}[/bold]: {escape(result.sweep.error)} beyond {figure(result.sweep.bound)}",
            highlight=False,
        )
        for name, limit in result.sweep.breaks().items():
            where = "nowhere in the sweep" if limit is None else f"at {escape(result.sweep.difficulty)} = {limit:.3g}"
            console.print(f"  {escape(name)}: {where}", highlight=False)


def write_json(path: Path, results: Sequence[Result]) -> None:
    """Write {"cases": [...]} with an entry for each row; non-finite values are null."""
    cases = [
        {
            "name": f"{result.case}.{row.name}",
            "bound": row.bound,
            "measured": row.measured,
            "verdict": verdict(row.passes),
            "baseline_measured": row.baseline_measured,
            "baseline_verdict": verdict(row.baseline_passes),
        }
        for result in results
        for row in result.figures.rows
    ]
    json_file.write_json(path, {"cases": cases})
