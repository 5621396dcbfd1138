"""Other simulators on the cases of `lapwing stability`, with the step of each case and otherwise default settings.

A file has `CASES`: for each case that the simulator can run, a function that returns the error of each method by row.
Files that begin with _ have functions for several simulators.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from benchmarks.other_simulators import installed
from lapwing.studies.stability import cases

Errors = Mapping[str, Mapping[str, float]]  # errors by row and method


def errors(case: str) -> dict[str, dict[str, float]]:
    """Return the errors of the installed simulators on a case: by row, by simulator and method."""
    result: dict[str, dict[str, float]] = {}
    for simulator in installed(__name__):
        if case in simulator.CASES:
            for row, measured in simulator.CASES[case]().items():
                result.setdefault(row, {}).update(measured)
    return result


def main(names: Sequence[str] = ()) -> None:
    """Print each row that another simulator can run: bound, Lapwing, baseline and the others."""
    covered = {case for simulator in installed(__name__) for case in simulator.CASES}
    for name in names or sorted(covered):
        with np.errstate(all="ignore"):
            rows, others = cases.get(name).run().rows, errors(name)
        for row in rows:
            results = {"Lapwing": row.measured, row.baseline: row.baseline_measured, **others.get(row.name, {})}
            print(f"{name}.{row.name}: {row.invariant}, bound {row.bound:.2g}")
            for method, value in results.items() if row.name in others else ():
                print(f"  {method:<40} {value:.2g}")
