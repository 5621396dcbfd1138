"""python -m benchmarks.landings: ratio of error to required accuracy in 200 random landings and other contacts."""

import argparse
from collections.abc import Collection
from pathlib import Path

import numpy as np

from lapwing.studies.accuracy.landings.cases import ACCURACIES, DRAWS
from lapwing.studies.accuracy.landings.measure import LandingErrors, measure, ratios, read, write


def main() -> None:
    """Print the table of docs/explanation/accuracy.md."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.landings")
    parser.add_argument(
        "--kind",
        choices=list(DRAWS),
        default="random",
        help="random landings, at steps, on folds of a grid, toppling, or with propeller strikes [default: random]",
    )
    parser.add_argument("--first", type=int, default=0, help="number of the first landing [default: 0]")
    parser.add_argument("--count", type=int, default=200, help="number of landings [default: 200]")
    parser.add_argument("--processes", type=int, help="landings flown at once [default: number of processors]")
    parser.add_argument(
        "--json", type=Path, metavar="FILE", help="add the results to FILE; landings that it holds are not flown again"
    )
    options = parser.parse_args()
    landings = read(options.json) if options.json else {}
    seeds = [k for k in range(options.first, options.first + options.count) if k not in landings]
    for landing in measure(seeds, options.processes, options.kind):
        landings[landing.seed] = landing
        if options.json:
            write(options.json, landings.values())
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
    main()
