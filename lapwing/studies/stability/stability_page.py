"""Page of `lapwing stability`: rows, plots, and the difficulty at which each method breaks."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from lapwing.cosim.complete_file import write_text
from lapwing.studies.report import plot as report
from lapwing.studies.report.page import render
from lapwing.studies.report.sections import Section
from lapwing.studies.report.style import COLOURS
from lapwing.studies.stability.case_result import Plot, Sweep
from lapwing.studies.stability.case_runner import Result
from lapwing.studies.stability.console_output import distance, figure, verdict


def write(path: Path, results: Sequence[Result]) -> None:
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


def _plot(plot: Plot, caption: str = "") -> report.Plot:
    marks: list[report.Mark] = [
        report.Line(np.asarray(x, float), np.asarray(y, float), name, COLOURS[k % len(COLOURS)])
        for k, (name, x, y) in enumerate(plot.curves)
    ]
    if plot.bound is not None and not (plot.log_y and plot.bound <= 0.0):
        marks.append(report.Level(plot.bound, f"bound {plot.bound:.2g}"))
    panel = report.Panel(tuple(marks), plot.y_label, plot.x_label, timed=False, log_x=plot.log_x, log_y=plot.log_y)
    return report.Plot((panel,), caption, 3.4)
