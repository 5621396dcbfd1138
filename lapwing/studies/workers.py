"""Worker processes of a study, which end with the process that they work for, however that ends."""

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnContext
from typing import Any

from lapwing.cosim.run_errors import RunFailed

# What clears away the semaphores of a process that was killed says so otherwise
SILENT = "ignore::UserWarning:multiprocessing.resource_tracker"


@contextmanager
def workers(number: int) -> Iterator[ProcessPoolExecutor]:
    """Yield a pool of processes that end with the block, at once on an error, and with this process.

    Raises:
        ValueError: inter-process communication is not available.
    """
    # spawned: a fork of a process with threads may hang, and would hold the other end of the pipe
    context = multiprocessing.get_context("spawn")
    theirs, ours = context.Pipe(duplex=False)
    with ours, _pool(number, context, theirs) as pool:
        try:
            yield pool
        except BaseException:
            ours.close()  # unfinished work is not needed
            raise
        finally:
            pool.shutdown(cancel_futures=True)


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


def _pool(number: int, context: SpawnContext, parent: Connection) -> ProcessPoolExecutor:
    try:
        sys.warnoptions.append(SILENT)
        resource_tracker.ensure_running()
        sys.warnoptions.remove(SILENT)
        return ProcessPoolExecutor(number, context, _end_with, (parent,))
    except OSError as fault:
        reason = (fault.strerror or str(fault)).lower()
        raise ValueError(f"worker processes need semaphores: {reason}; expected a /dev/shm to write to") from None


def _end_with(parent: Connection) -> None:
    """Let this process end as soon as the other end of the pipe is closed, by whom or by what death ever."""

    def watch() -> None:
        parent.poll(None)
        os._exit(1)

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's, who closes the pipe
    threading.Thread(target=watch, daemon=True).start()
