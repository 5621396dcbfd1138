"""`lapwing stability`: run, print, and write what was asked for."""

import sys
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from lapwing.studies.stability import console_output, stability_page
from lapwing.studies.stability.case_runner import measure, select

WIDTH = 180  # letters of a table that goes to no terminal


def run(case: str | None, long: bool, sweep: bool, json: Path | None, report: Path | None) -> bool:
    """Run one case, or all. Return True if all pass.

    Args:
        case: name of a case; None: all.
        long: include the slow cases.
        sweep: increase the difficulty until each method fails.
        json: file for the numbers.
        report: file for the page.

    Raises:
        ValueError: there is no such case, or it has no sweep.
    """
    console = Console(width=None if sys.stdout.isatty() else WIDTH)
    names = select(case, long, sweep)
    columns = (TextColumn("running the cases (the first time they are compiled)"), BarColumn(), MofNCompleteColumn())
    with Progress(*columns, TimeElapsedColumn(), console=console, transient=True) as progress:
        task = progress.add_task("", total=len(names))
        results = measure(names, sweep, lambda name: progress.advance(task))
    console_output.table(console, results)
    console_output.sweeps(console, results)
    if json:
        console_output.write_json(json, results)
    if report:
        stability_page.write(report, results)
    short = [result.case for result in results if not result.is_conclusive]
    if short:
        console.print(f"\nfalls short: {', '.join(short)}", highlight=False)
    return not short
