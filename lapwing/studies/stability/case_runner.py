"""Execution of cases in worker processes, one per processor."""

import os
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import as_completed
from typing import NamedTuple

import numpy as np

from lapwing.studies.stability import cases
from lapwing.studies.stability.case_result import CaseResult, Plot, Row, Sweep
from lapwing.studies.workers import workers


class Result(NamedTuple):
    """Result of a case with its difficulty and run time."""

    case: str
    hard: str
    figures: CaseResult
    sweep: Sweep | None
    seconds: float  # [s] wall time

    @property
    def is_conclusive(self) -> bool:
        """True if every row is conclusive."""
        return all(row.is_conclusive for row in self.figures.rows)


def select(case: str | None, long: bool, sweep: bool) -> list[str]:
    """Return the names of the cases to run: one, or all; slow ones only with `long`.

    Raises:
        ValueError: the case is unknown, or has no sweep.
    """
    if case is None:
        selected = [name for name in cases.names() if long or not getattr(cases.get(name), "LONG", False)]
        return [name for name in selected if not sweep or hasattr(cases.get(name), "sweep")]
    if sweep and not hasattr(cases.get(case), "sweep"):
        with_sweep = ", ".join(name for name in cases.names() if hasattr(cases.get(name), "sweep"))
        raise ValueError(f"--sweep: {case} has no sweep; expected one of {with_sweep}")
    return [cases.get(case).__name__.rpartition(".")[2]]


def measure(names: Sequence[str], sweep: bool) -> Iterator[Result]:
    """Yield the result of each of these cases when it is finished.

    Args:
        names: names of cases.
        sweep: also run the sweep of the difficulty.
    """
    number = min(len(names), os.cpu_count() or 1)
    if number == 1:
        yield from (run_case(name, sweep) for name in names)
        return
    with workers(number) as pool:
        for job in as_completed([pool.submit(run_case, name, sweep) for name in names]):
            yield job.result()


def run_case(name: str, sweep: bool) -> Result:
    """Return the result of one case; an error makes it fail and is part of the result."""
    module, started = cases.get(name), time.perf_counter()
    try:
        with np.errstate(all="ignore"):  # methods that diverge overflow, which the case measures
            result = module.run()
    except (ArithmeticError, LookupError, RuntimeError, ValueError) as error:
        reason = f"ended in an error: {error}"
        result = CaseResult([Row(name, "", reason, 0.0, "", np.nan, "", np.nan)], Plot("", "", []))
    with np.errstate(all="ignore"):
        sweep_result = module.sweep() if sweep else None
    return Result(name, module.HARD, result, sweep_result, time.perf_counter() - started)
