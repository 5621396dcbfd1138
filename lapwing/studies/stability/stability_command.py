"""`lapwing stability`: run the cases, print the results, and write them to the requested files."""

import sys
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from lapwing.studies.stability import console_output, stability_page
from lapwing.studies.stability.case_runner import measure, select

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
        stability_page.write(report, results)
    failing = [result.case for result in results if not result.is_conclusive]
    if failing:
        console.print(f"\nfailing cases: {', '.join(failing)}", highlight=False)
    return not failing
