"""Other simulators on the cases of `lapwing stability`, with the step of each case and otherwise default settings.

    python -m benchmarks.stability [CASES...]

Simulators that are not installed (extra `bench`) are skipped.
"""

from typing import Annotated

import numpy as np
import typer

from benchmarks import _simulators
from benchmarks._command import command_line
from lapwing.studies.stability import cases

SLOW = True


def errors(case: str) -> dict[str, dict[str, float]]:
    """Return the errors of the installed simulators on a case: by row, by simulator and method."""
    result: dict[str, dict[str, float]] = {}
    for simulator in _simulators.installed():
        if case in simulator.CASES:
            for row, measured in simulator.CASES[case]().items():
                result.setdefault(row, {}).update(measured)
    return result


def main(names: Annotated[list[str] | None, typer.Argument(metavar="[CASES]...")] = None) -> None:
    covered = {case for simulator in _simulators.installed() for case in simulator.CASES}
    for name in names or sorted(covered):
        with np.errstate(all="ignore"):
            rows, others = cases.get(name).run().rows, errors(name)
        for row in rows:
            results = {"Lapwing": row.measured, row.baseline: row.baseline_measured, **others.get(row.name, {})}
            print(f"{name}.{row.name}: {row.invariant}, bound {row.bound:.2g}")
            for method, value in results.items() if row.name in others else ():
                print(f"  {method:<40} {value:.2g}")


if __name__ == "__main__":
    command_line(main)
