"""A campaign as a table, as JSON and as a plot."""

import json
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, PercentFormatter
from rich.console import Console
from rich.table import Table

from studies.campaign.study import Campaign, Spread
from studies.report.paper import styled
from studies.report.style import AXIS_COLOURS, DPI, FLOWN, REFERENCE, WIDTH
from studies.tracking import AXES, shown

LISTED = 10  # flights that did not land, in the terminal
THIRD = 1.0 / 3.0  # of the published error: what a well-tuned flight is to stay below


def show(console: Console, found: Campaign) -> None:
    """Print the campaign for people."""
    seeds = [f.seed for f in found.flights]
    console.print(f"{found.scene}: {len(seeds)} flights, seeds {min(seeds)} to {max(seeds)}", highlight=False)
    _table(console, "Root-mean-square error of the reference against the truth", found.rmse, found)
    if found.rmse != found.rmse_estimate:
        _table(console, "The same against the vehicle's own estimate", found.rmse_estimate, found)
        shares = ", ".join(
            f"{axis} {np.mean([f.inside[i] for f in found.flights]):.2%}" for i, axis in enumerate("xyz")
        )
        console.print(f"Truth within 3 sigma of the estimate: {shares} of the time", highlight=False)
        least = ", ".join(f"{axis} {s.worst:.1%} (seed {s.seed})" for axis, s in found.inside.items())
        console.print(f"Least of a flight: {least}", highlight=False)
    if len(seeds) > 1 and all(s.low == s.worst for s in found.rmse.values()):
        console.print("Every seed gives the same flight: nothing in this scene is random", highlight=False)
    console.print(f"{len(seeds)} flights: {found.counts}", highlight=False)
    for f in found.failed[:LISTED]:
        console.print(f"  seed {f.seed}: {f.verdict}", highlight=False)
    if len(found.failed) > LISTED:
        console.print(f"  and {len(found.failed) - LISTED} more: --json has all of them", highlight=False)


def _table(console: Console, title: str, spreads: dict[str, Spread], found: Campaign) -> None:
    table = Table(title=title, title_justify="left")
    table.add_column("axis", no_wrap=True)
    for column in ("5 %", "median", "95 %", "worst", "of seed"):
        table.add_column(column, justify="right", no_wrap=True)
    if found.published:
        table.add_column(found.source, justify="right")
        table.add_column("worst / that", justify="right")
    for axis in AXES:
        s, (unit, scale) = spreads[axis], shown(axis)
        row = [f"{axis} [{unit}]", *(f"{scale * v:.4f}" for v in (s.low, s.median, s.high, s.worst)), str(s.seed)]
        if axis in found.published:
            row += [f"{scale * found.published[axis]:.4f}", f"{s.worst / found.published[axis]:.3f}"]
        table.add_row(*row)
    console.print(table)


def write_json(path: Path, found: Campaign) -> None:
    """Write the campaign, flight by flight, for other programs."""

    def plain(spreads: dict[str, Spread]) -> dict:
        return {axis: s._asdict() for axis, s in spreads.items()}

    data = {
        **found._asdict(),
        "flights": [{**f._asdict(), "verdict": f.verdict._asdict()} for f in found.flights],
        "rmse": plain(found.rmse),
        "rmse_estimate": plain(found.rmse_estimate),
        "inside": plain(found.inside),
        "failed": [f.seed for f in found.failed],
    }
    path.write_text(json.dumps(data, indent=2) + "\n", encoding="utf-8")


def plot(path: Path, found: Campaign) -> None:
    """How many flights stay below which error, an axis a panel, beside what is published."""
    with styled():
        figure = Figure(figsize=(WIDTH, 5.6), dpi=DPI, layout="constrained")
        panels = figure.subplots(2, 3, sharey=True)
        for (axis, unit), panel in zip(AXES.items(), panels.flat, strict=True):
            panel.ecdf([f.rmse[axis] for f in found.flights], color=FLOWN, label="against the truth")
            if found.rmse != found.rmse_estimate:
                values = [f.rmse_estimate[axis] for f in found.flights]
                panel.ecdf(values, color=AXIS_COLOURS[1], label="against the estimate")
            if axis in found.published:
                panel.axvline(found.published[axis], color=REFERENCE, linewidth=1.1, label=found.source)
                third = THIRD * found.published[axis]
                panel.axvline(third, color=REFERENCE, linestyle=(0, (4, 3)), linewidth=1.1, label="a third of it")
            if min(f.rmse[axis] for f in found.flights) > 0.0:
                panel.set_xscale("log")
                panel.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
                panel.xaxis.set_minor_formatter(NullFormatter())
            panel.xaxis.set_major_formatter("{x:g}")
            panel.set_xlabel(f"RMSE of {axis} [{unit}]")
            panel.set_ylim(0.0, 1.0)
            panel.yaxis.set_major_formatter(PercentFormatter(1.0))
        for row in panels:
            row[0].set_ylabel("share of flights with a smaller error")
        lines, names = panels[0, 0].get_legend_handles_labels()
        figure.legend(lines, names, loc="outside lower center", ncols=len(names))
        figure.suptitle(f"{found.scene}: {found.counts}", fontsize=10)
        figure.savefig(path)
