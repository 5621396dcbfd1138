"""Result of `lapwing stability`."""

import math
from collections.abc import Sequence
from functools import partial

import numpy as np

from lapwing.studies.stability.case_result import Plot, Sweep
from lapwing.studies.stability.case_runner import Result
from lapwing.views.report import plot as report_plot
from lapwing.views.report.style import COLOURS
from lapwing.views.studies.study_result import Rows, StudyResult
from lapwing.views.terminal import counted

TEXTS = ("invariant", "method", "baseline method")
HEADS = ("invariant", "method", "bound", "measured", "margin", "verdict", "baseline method", "its result")


def result(results: Sequence[Result]) -> StudyResult:
    """Return the result of some cases: their rows with bounds, and those of the baseline methods."""
    failing = [each.case for each in results if not each.is_conclusive]
    verdict = f"failing cases: {', '.join(failing)}" if failing else "all cases hold their bounds"
    plots = {}
    for each in results:
        plots[each.case] = partial(_plot, each.figures.plot)
        if each.sweep:
            title = f"{each.case}: difficulty at which each method breaks"
            plots[title] = partial(_plot, each.sweep.plot())
    return StudyResult(
        f"Numerical stability: {counted(len(results), 'hard case')}", verdict, "bad" if failing else "good",
        ("each result with its bound, and the result of a baseline method on the same case",),
        tuple(map(_rows, results)), plots,
        tuple(f"{each.case}: {line}" for each in results if each.sweep for line in _breaks(each.sweep)),
        data={
            "cases": [
                {
                    "name": f"{each.case}.{row.name}",
                    "bound": row.bound,
                    "measured": row.measured,
                    "verdict": _verdict(row.passes),
                    "baseline_measured": row.baseline_measured,
                    "baseline_verdict": _verdict(row.baseline_passes),
                }
                for each in results
                for row in each.figures.rows
            ]
        },
    )  # fmt: skip


def _rows(each: Result) -> Rows:
    rows = Rows(f"{each.case}: {each.hard} ({each.seconds:.1f} s)", *HEADS, texts=TEXTS)
    for row in each.figures.rows:
        baseline = f"{_number(row.baseline_measured)} ({_verdict(row.baseline_passes)})"
        invariant = f"{row.name}: {row.invariant}"
        rows.add(
            f"{invariant}; bound: {row.why}" if row.why else invariant, row.method, _number(row.bound),
            _number(row.measured), distance(row.bound, row.measured), _verdict(row.passes), row.baseline, baseline,
            failed=not row.is_conclusive,
        )  # fmt: skip
    return rows


def _breaks(sweep: Sweep) -> list[str]:
    """Return for each method the difficulty at which it breaks."""
    hint = " (smaller is harder)" if sweep.falling else ""
    return [
        f"{name} "
        + ("holds in the whole sweep" if limit is None else f"breaks at {sweep.difficulty} = {_number(limit)}{hint}")
        for name, limit in sweep.breaks().items()
    ]


def _plot(plot: Plot) -> report_plot.Plot:
    marks: list[report_plot.Mark] = [
        report_plot.Line(np.asarray(x, float), np.asarray(y, float), name, COLOURS[k % len(COLOURS)])
        for k, (name, x, y) in enumerate(plot.curves)
    ]
    if plot.bound is not None and not (plot.log_y and plot.bound <= 0.0):
        marks.append(report_plot.Level(plot.bound, f"bound {plot.bound:.2g}"))
    panel = report_plot.Panel(tuple(marks), plot.y_label, plot.x_label, timed=False, log_x=plot.log_x, log_y=plot.log_y)
    return report_plot.Plot((panel,), "", 3.4)


def _number(value: float) -> str:
    return f"{value:.2g}" if math.isfinite(value) else str(value)


def _verdict(passes: bool) -> str:
    return "pass" if passes else "fail"


def distance(bound: float, measured: float) -> str:
    """Return the ratio of bound to measured value; "" if undefined, "exact" for 0."""
    if bound == 0.0 or not math.isfinite(measured):
        return ""
    if measured == 0.0:
        return "exact"
    digits = 3 if measured > 0.1 * bound else 1
    return f"{float(f'{bound / measured:.{digits}g}'):g} x"
