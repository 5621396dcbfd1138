"""The workers of a Dask cluster, however it was made: by `dask worker`, by dask-jobqueue, by dask-kubernetes.

Dask hands a task of a worker that is lost to another one, and hands tasks to workers that join late. Each worker checks
before its first task that it flies what the campaign was begun with (`runs.fly_runs`).
"""

import logging
from collections.abc import Callable, Iterable, Iterator
from typing import Any

from lapwing.cosim.run_errors import RunFailed

PATIENCE = 10.0  # [s] for the scheduler to answer


def dask(
    address: str, say: Callable[[str], None] = lambda line: None
) -> Callable[[Callable[..., Any], Iterable[tuple]], Iterator[tuple[int, Any]]]:
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
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # it tells of a lost scheduler by a traceback
    try:
        client = Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as fault:
        raise ValueError(f"--cluster {address}: no Dask scheduler answers there: {fault}") from None

    def run(call: Callable[..., Any], tasks: Iterable[tuple]) -> Iterator[tuple[int, Any]]:
        with client:
            if not client.nthreads():
                say(f"{address}: no worker has joined the scheduler yet; the campaign waits for one")
            futures = {client.submit(call, *task, pure=False): place for place, task in enumerate(tasks)}
            try:
                for future in as_completed(list(futures), loop=client.loop):
                    yield futures[future], future.result()
                    future.release()  # its rows need stay nowhere
            except KilledWorker:
                message = "a task has lost one worker after the other, perhaps for want of memory"
                raise RunFailed(f"{message}; the same command goes on where it stopped") from None
            except (FutureCancelledError, OSError, TimeoutError):
                message = f"the scheduler at {address} is lost"
                raise RunFailed(f"{message}; the same command goes on where it stopped") from None
            finally:
                if left := [future for future in futures if not future.done()]:
                    client.cancel(left)

    return run
