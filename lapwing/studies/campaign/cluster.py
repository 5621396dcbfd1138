"""Execution of a campaign on the workers of a Dask cluster: `dask worker`, dask-jobqueue, dask-kubernetes.

Dask reassigns the tasks of a lost worker, and assigns tasks to workers that join late. Before its first task each
worker checks that it reproduces the reference of the campaign (`runs.fly_runs`).
"""

import logging
from collections.abc import Callable, Iterable, Iterator
from typing import Any

from lapwing.cosim.run_errors import RunFailed
from lapwing.studies.workers import Workers

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
