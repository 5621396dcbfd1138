"""Workers of a study: local processes, which always end with their parent process, or those of a Dask cluster.

A cluster (`dask worker`, dask-jobqueue, dask-kubernetes) runs a campaign. Dask reassigns the tasks of a lost worker,
and assigns tasks to workers that join late. Before its first task each worker checks that it reproduces the reference
of the campaign (`runs.fly_runs`).
"""

import logging
import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnContext
from typing import Any

from lapwing.cosim.processes.patience import Patience
from lapwing.cosim.run_errors import RunFailed

# Suppresses the warning of the resource tracker when it removes semaphores of a killed process
NO_TRACKER_WARNING = "ignore::UserWarning:multiprocessing.resource_tracker"


Workers = Callable[[Callable[..., Any], Iterable[tuple]], Iterator[tuple[int, Any]]]
"""(call, tasks) -> (index of the task, call(*task)) in order of completion."""


END_TIMEOUT = 1.0  # [s] from an error to the end of all workers
POLL = 0.02  # [s] between two checks whether they have ended
REPEAT = "run the same command again"  # advice after a lost process
CONTINUE = f"{REPEAT} to continue"  # if the results so far are kept


@contextmanager
def workers(number: int, advice: str = REPEAT) -> Iterator[ProcessPoolExecutor]:
    """Yield a pool of processes that end with the block, immediately on an error, or with this process.

    Args:
        number: number of processes.
        advice: end of the message about a lost process.

    Raises:
        RunFailed: a process is lost.
        ValueError: inter-process communication is not available.
    """
    # spawned: a fork of a process with threads may hang, and would inherit the other end of the pipe
    context = multiprocessing.get_context("spawn")
    theirs, ours = context.Pipe(duplex=False)
    with ours:
        pool = _pool(number, context, theirs)  # ended once: an interrupted end does not allow another
        try:
            yield pool
        except BaseException as error:
            ours.close()  # unfinished work is not needed
            threading.Thread(target=_kill_late, daemon=True).start()
            if isinstance(error, BrokenProcessPool):
                message = "a worker process has ended unexpectedly, perhaps out of memory"
                raise RunFailed(f"{message}; {advice}") from None
            raise
        finally:
            pool.shutdown(cancel_futures=True)


def run_here(call: Callable[..., Any], tasks: Iterable[tuple]) -> Iterator[tuple[int, Any]]:
    """Yield the index of each task and the result of call(*task), computed in this process."""
    for index, task in enumerate(tasks):
        yield index, call(*task)


def processes(count: int) -> Workers:
    """Return a function like `run_here` that uses `count` processes and yields results as they complete."""

    def run(call: Callable[..., Any], tasks: Iterable[tuple]) -> Iterator[tuple[int, Any]]:
        with workers(count, CONTINUE) as pool:
            indices = {pool.submit(call, *task): index for index, task in enumerate(tasks)}
            for future in as_completed(list(indices)):
                yield indices.pop(future), future.result()

    return run


def cores() -> int:
    """Return the number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _pool(number: int, context: SpawnContext, parent: Connection) -> ProcessPoolExecutor:
    try:
        sys.warnoptions.append(NO_TRACKER_WARNING)
        resource_tracker.ensure_running()
        sys.warnoptions.remove(NO_TRACKER_WARNING)
        return ProcessPoolExecutor(number, context, _end_with, (parent,))
    except OSError as fault:
        reason = (fault.strerror or str(fault)).lower()
        raise ValueError(f"worker processes need semaphores: {reason}; expected a /dev/shm to write to") from None


def _kill_late() -> None:
    """Kill the workers that do not end by themselves: one whose library holds the GIL does not see the closed pipe."""
    children = multiprocessing.active_children()
    patience = Patience(END_TIMEOUT, *(child.pid for child in children))
    while any(child.is_alive() for child in children) and not patience.over:
        time.sleep(POLL)
    for child in children:
        child.kill()


def _end_with(parent: Connection) -> None:
    """End this process when the other end of the pipe is closed, including by the death of the parent."""

    def watch() -> None:
        parent.poll(None)
        os._exit(1)

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent, which closes the pipe
    threading.Thread(target=watch, daemon=True).start()


SCHEDULER_TIMEOUT = 10.0  # [s]


def dask(address: str, notify: Callable[[str], None] = lambda line: None) -> Workers:
    """Return a function that runs calls on the workers of a Dask scheduler, tcp://host:8786.

    Raises:
        ValueError: Dask is not installed, or the scheduler does not answer.
    """
    try:
        from distributed import Client, as_completed
        from distributed.client import FutureCancelledError
        from distributed.scheduler import KilledWorker
    except ImportError:
        raise ValueError("--cluster: Dask is not installed; pip install lapwing[cluster]") from None
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # it logs a traceback if the scheduler is lost
    try:
        client = Client(address, timeout=SCHEDULER_TIMEOUT, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as fault:
        raise ValueError(f"--cluster {address}: no Dask scheduler answers: {fault}; expected tcp://HOST:PORT") from None

    def run(call: Callable[..., Any], tasks: Iterable[tuple]) -> Iterator[tuple[int, Any]]:
        with client:
            if not client.nthreads():
                notify(f"{address}: no worker has joined the scheduler; waiting for one")
            futures = {client.submit(call, *task, pure=False): index for index, task in enumerate(tasks)}
            try:
                for future in as_completed(list(futures), loop=client.loop):
                    yield futures[future], future.result()
                    future.release()  # frees its rows in the cluster
            except KilledWorker:
                message = "a task has repeatedly lost its worker, possibly out of memory"
                raise RunFailed(f"{message}; repeat the command to continue") from None
            except (FutureCancelledError, OSError, TimeoutError):
                message = f"the scheduler at {address} is lost"
                raise RunFailed(f"{message}; repeat the command to continue") from None
            finally:
                if unfinished := [future for future in futures if not future.done()]:
                    client.cancel(unfinished)

    return run
