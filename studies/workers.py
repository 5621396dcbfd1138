"""Worker processes of a study, which end with the process that they work for, however that ends."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing.connection import Connection


@contextmanager
def workers(number: int) -> Iterator[ProcessPoolExecutor]:
    """A pool of processes that end with the block, at once where it ends with an error, and with this process."""
    # spawned: a fork of a process with threads may hang, and would hold the other end of the pipe
    context = multiprocessing.get_context("spawn")
    theirs, ours = context.Pipe(duplex=False)
    with ours, ProcessPoolExecutor(number, context, _end_with, (theirs,)) as pool:
        try:
            yield pool
        except BaseException:
            ours.close()  # nobody waits for what is being worked on
            raise
        finally:
            pool.shutdown(cancel_futures=True)


def _end_with(parent: Connection) -> None:
    """Let this process end as soon as the other end of the pipe is closed, by whom or by what death ever."""

    def watch() -> None:
        parent.poll(None)
        os._exit(1)

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's, who closes the pipe
    threading.Thread(target=watch, daemon=True).start()
