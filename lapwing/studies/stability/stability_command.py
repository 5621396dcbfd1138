"""`lapwing stability`: run, print, and write what was asked for."""

import sys
from pathlib import Path

from rich.console import Console
from rich.progress import Progress

from lapwing.studies.stability import console_output, stability_page
from lapwing.studies.stability.case_runner import chosen, measure

WIDTH = 180  # letters of a table that goes to no terminal


def run(case: str | None, long: bool, sweep: bool, json: Path | None, report: Path | None) -> bool:
    """Study one case, or all; whether all of them stand.

    Args:
        case: its name, None for all.
        long: with those that take minutes.
        sweep: walk the difficulty until each method breaks.
        json: file for the figures.
        report: file for the page.

    Raises:
        ValueError: no such case, or one that cannot be swept.
    """
    console = Console(width=None if sys.stdout.isatty() else WIDTH)
    names = chosen(case, long, sweep)
    with Progress(console=console, transient=True) as progress:
        task = progress.add_task("running the cases (the first time they are compiled)", total=len(names))
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
