"""`lapwing stability`: run the cases, print the results, and write them to the requested files."""

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from lapwing.cosim.complete_file import write_text
from lapwing.studies.report import plot as report_plot
from lapwing.studies.report.page import render
from lapwing.studies.report.sections import Section
from lapwing.studies.report.style import COLOURS
from lapwing.studies.stability import console_output
from lapwing.studies.stability.case_result import Plot, Sweep
from lapwing.studies.stability.case_runner import Result, measure, select
from lapwing.studies.stability.console_output import distance, figure, verdict

WIDTH = 180  # characters of a table without a terminal


def run(case: str | None, long: bool, sweep: bool, json: Path | None, report: Path | None) -> bool:
    """Run one case, or all. Return True if all pass.

    Args:
        case: name of a case; None: all.
        long: include the slow cases.
        sweep: also increase the difficulty until each method fails.
        json: output file for the results; None: no file.
        report: output file for the page; None: no file.

    Raises:
        ValueError: the case is unknown or has no sweep, or a file cannot be written.
    """
    console = Console(width=None if sys.stdout.isatty() else WIDTH)
    names = select(case, long, sweep)
    columns = (TextColumn("running the cases (the first run compiles them)"), BarColumn(), MofNCompleteColumn())
    with Progress(*columns, TimeElapsedColumn(), console=console, transient=True) as progress:
        task = progress.add_task("", total=len(names))
        results = measure(names, sweep, lambda name: progress.advance(task))
    console_output.table(console, results)
    console_output.sweeps(console, results)
    if json:
        console_output.write_json(json, results)
    if report:
        write_page(report, results)
    failing = [result.case for result in results if not result.is_conclusive]
    if failing:
        console.print(f"\nfailing cases: {', '.join(failing)}", highlight=False)
    return not failing


def write_page(path: Path, results: Sequence[Result]) -> None:
    """Write the page.

    Raises:
        ValueError: the file cannot be written.
    """
    text = render(
        "stability.html",
        list(_sections(results)),
        results={result.case: result for result in results},
        number=figure,
        verdict=verdict,
        distance=distance,
    )
    write_text(path, text)


def _sections(results: Sequence[Result]) -> Iterator[Section]:
    for result in results:
        yield Section(result.case, result.case, _plot(result.figures.plot))
        if result.sweep:
            title = f"{result.case}: difficulty at which each method breaks"
            yield Section(f"{result.case}_sweep", title, _plot(result.sweep.plot(), _breaks(result.sweep)))


def _breaks(sweep: Sweep) -> str:
    texts = [
        f"{name}: {'nowhere in the sweep' if limit is None else f'at {sweep.difficulty} = {figure(limit)}'}"
        for name, limit in sweep.breaks().items()
    ]
    return "; ".join(texts) + "."


def _plot(plot: Plot, caption: str = "") -> report_plot.Plot:
    marks: list[report_plot.Mark] = [
        report_plot.Line(np.asarray(x, float), np.asarray(y, float), name, COLOURS[k % len(COLOURS)])
        for k, (name, x, y) in enumerate(plot.curves)
    ]
    if plot.bound is not None and not (plot.log_y and plot.bound <= 0.0):
        marks.append(report_plot.Level(plot.bound, f"bound {plot.bound:.2g}"))
    panel = report_plot.Panel(tuple(marks), plot.y_label, plot.x_label, timed=False, log_x=plot.log_x, log_y=plot.log_y)
    return report_plot.Plot((panel,), caption, 3.4)
