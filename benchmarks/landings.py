"""python -m benchmarks.landings [COUNT]: error got over error asked in random landings, 200 if no number is given."""

import sys

import numpy as np

from lapwing.studies.accuracy.landings.cases import ACCURACIES
from lapwing.studies.accuracy.landings.measure import measure, ratios


def main() -> None:
    """Print the table of docs/explanation/accuracy.md."""
    found = measure(int(sys.argv[1]) if len(sys.argv) > 1 else 200)
    table = ratios(found)
    events = sum(landing.events for landing in found)
    print(f"{len(found)} landings, {events} located events; error got over error asked, whole state, every 4 ms")
    print(f"{'asked':>8} {'median':>9} {'nine in ten':>12} {'largest':>9} {'above 1':>8} {'ms each':>9}")
    seconds = np.array([landing.seconds for landing in found])
    for k, accuracy in enumerate(ACCURACIES):
        column = table[:, k]
        print(
            f"{accuracy:8.0e} {np.median(column):9.2g} {np.quantile(column, 0.9):12.2g} {column.max():9.2g} "
            f"{(column > 1.0).sum():8d} {1e3 * seconds[:, k].mean():9.3g}"
        )
    for landing, row in zip(found, table, strict=True):
        if row.max() > 1.0:
            k = int(row.argmax())
            print(f"landing {landing.seed}: {row[k]:.2g} at {ACCURACIES[k]:.0e}, {landing.worst[k]:.3f} s")


if __name__ == "__main__":
    main()
