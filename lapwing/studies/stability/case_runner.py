"""Runs cases in worker processes, as many at once as there are processors."""

import os
import time
from collections.abc import Callable, Sequence
from concurrent.futures import as_completed
from typing import NamedTuple

import numpy as np

from lapwing.studies.stability import cases
from lapwing.studies.stability.case_result import CaseResult, Plot, Row, Sweep
from lapwing.studies.workers import workers


class Result(NamedTuple):
    """A case and what it came to."""

    case: str
    hard: str
    figures: CaseResult
    sweep: Sweep | None
    seconds: float  # of wall time

    @property
    def is_conclusive(self) -> bool:
        """True if every row is conclusive."""
        return all(row.is_conclusive for row in self.figures.rows)


def select(case: str | None, long: bool, sweep: bool) -> list[str]:
    """Return the names of the cases to run: one, or all; slow ones only with `long`.

    Raises:
        ValueError: there is no such case, or it has no sweep.
    """
    if case is None:
        every = [name for name in cases.names() if long or not getattr(cases.get(name), "LONG", False)]
        return [name for name in every if not sweep or hasattr(cases.get(name), "sweep")]
    if sweep and not hasattr(cases.get(case), "sweep"):
        able = ", ".join(name for name in cases.names() if hasattr(cases.get(name), "sweep"))
        raise ValueError(f"--sweep: the difficulty of {case} is not walked; expected one of {able}")
    return [cases.get(case).__name__.rpartition(".")[2]]


def measure(names: Sequence[str], sweep: bool, progress: Callable[[str], None]) -> list[Result]:
    """Return the results of these cases, in order.

    Args:
        names: names of cases.
        sweep: also run the sweep of the difficulty.
        progress: called with the name of each finished case.
    """
    number = min(len(names), os.cpu_count() or 1)
    if number == 1:
        return [_report(one(name, sweep), progress) for name in names]
    with workers(number) as pool:
        jobs = {pool.submit(one, name, sweep): name for name in names}
        done = {jobs[job]: _report(job.result(), progress) for job in as_completed(jobs)}
    return [done[name] for name in names]


def one(name: str, sweep: bool) -> Result:
    """Return the result of one case; an error makes it fail and is part of the result."""
    module, started = cases.get(name), time.perf_counter()
    try:
        with np.errstate(all="ignore"):  # methods that break run over; that is what is measured
            result = module.run()
    except (ArithmeticError, LookupError, RuntimeError, ValueError) as error:
        why = f"ended in an error: {error}"
        result = CaseResult([Row(name, "", why, 0.0, "", np.nan, "", np.nan)], Plot("", "", []))
    with np.errstate(all="ignore"):
        walked = module.sweep() if sweep else None
    return Result(name, module.HARD, result, walked, time.perf_counter() - started)


def _report(result: Result, progress: Callable[[str], None]) -> Result:
    progress(result.case)
    return result
