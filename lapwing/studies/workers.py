"""Worker processes of a study, which end with the process that they work for, however that ends."""

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnContext

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
