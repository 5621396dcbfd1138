"""Ratio of error to required accuracy in random landings, and in other contacts: at steps, on folds of a grid, ...

    python -m benchmarks.landings [--kind KIND] [--first N] [--count N] [--json FILE]

Prints a table of docs/explanation/accuracy.md.
"""

from collections.abc import Collection
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import numpy as np
from typer import Option

from benchmarks._command import command_line
from lapwing.studies.accuracy.landings.cases import ACCURACIES, DRAWS
from lapwing.studies.accuracy.landings.measure import LandingErrors, measure, ratios, read, write

Kind = StrEnum("Kind", {name: name for name in DRAWS})


def main(
    kind: Annotated[Kind, Option(help="random or special landings")] = Kind.random,
    first: Annotated[int, Option(help="number of the first landing")] = 0,
    count: Annotated[int, Option(help="number of landings")] = 200,
    processes: Annotated[int | None, Option(help="landings flown at once; default: number of processors")] = None,
    results: Annotated[
        Path | None, Option("--json", help="add the results to this file; landings that it holds are not flown again")
    ] = None,
) -> None:
    landings = read(results) if results else {}
    seeds = [k for k in range(first, first + count) if k not in landings]
    for landing in measure(seeds, processes, kind):
        landings[landing.seed] = landing
        if results:
            write(results, landings.values())
    show(sorted(landings.values()))


def show(landings: Collection[LandingErrors]) -> None:
    """Print the distribution of the ratios, and the landings that miss their accuracy."""
    table = ratios(landings)
    events = sum(landing.events for landing in landings)
    print(f"{len(landings)} landings, {events} located events; error over accuracy, entire state, every 4 ms")
    print(f"{'required':>8} {'median':>9} {'nine in ten':>12} {'largest':>9} {'above 1':>8} {'ms each':>9}")
    seconds = np.array([landing.seconds for landing in landings])
    for k, accuracy in enumerate(ACCURACIES):
        column = table[:, k]
        print(
            f"{accuracy:8.0e} {np.median(column):9.2g} {np.quantile(column, 0.9):12.2g} {column.max():9.2g} "
            f"{(column > 1.0).sum():8d} {1e3 * np.median(seconds[:, k]):9.3g}"
        )
    for landing, row in zip(landings, table, strict=True):
        if row.max() > 1.0:
            k = int(row.argmax())
            missed = f"{row[k]:.2g} at {ACCURACIES[k]:.0e}, {landing.worst_time[k]:.3f} s"
            print(f"landing {landing.seed}: {missed}; round-off {landing.round_off:.2g}")


if __name__ == "__main__":
    command_line(main)
