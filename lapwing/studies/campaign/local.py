"""The workers of this machine: a process for each core, with kernels of its own, or none but this process."""

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import as_completed
from concurrent.futures.process import BrokenProcessPool
from typing import Any

from lapwing.cosim.run_errors import RunFailed
from lapwing.studies.workers import workers


def here(call: Callable[..., Any], tasks: Iterable[tuple]) -> Iterator[tuple[int, Any]]:
    """Yield the results of call(*task) in this process, each with the index of its task."""
    for place, task in enumerate(tasks):
        yield place, call(*task)


def processes(count: int) -> Callable[[Callable[..., Any], Iterable[tuple]], Iterator[tuple[int, Any]]]:
    """Run calls in `count` processes and yield each result when it is ready; the processes end with the loop."""

    def run(call: Callable[..., Any], tasks: Iterable[tuple]) -> Iterator[tuple[int, Any]]:
        with workers(count) as pool:
            places = {pool.submit(call, *task): place for place, task in enumerate(tasks)}
            try:
                for future in as_completed(list(places)):
                    yield places.pop(future), future.result()
            except BrokenProcessPool:
                message = "a worker process has ended before its time, perhaps for want of memory"
                raise RunFailed(f"{message}; the same command goes on where it stopped") from None

    return run


def cores() -> int:
    """Return the number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
