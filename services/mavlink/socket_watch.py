"""Watch of the sockets of endpoints, for a process that waits for messages of the run."""

import os
import selectors
import threading
from collections.abc import Callable


class SocketWatch:
    """Thread that waits for data of endpoints; a context manager.

    Messages of the run cause most wake-ups of a link. With this thread the main thread waits for those only, which
    takes fewer system calls than a wait for both.

    Attributes:
        ready: True if a socket is ready, until `resume`.
    """

    def __init__(self, selector: selectors.BaseSelector, wake: Callable[[], None]):
        """Start the thread.

        Args:
            selector: selector of the sockets, which another thread reads.
            wake: called in this thread when a socket is ready, and not again before `resume`.
        """
        self._selector, self._wake = selector, wake
        self.ready = self._closed = False
        self._resume = threading.Event()
        self._end = os.eventfd(0, os.EFD_NONBLOCK)
        selector.register(self._end, selectors.EVENT_READ, lambda: None)
        self._thread = threading.Thread(target=self._run, name="sockets", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while True:
            self._selector.select()
            if self._closed:
                return
            self.ready = True
            self._wake()
            self._resume.wait()
            self._resume.clear()

    def resume(self) -> None:
        """Resume the wait; called after all ready sockets have been served."""
        self.ready = False
        self._resume.set()

    def __enter__(self) -> "SocketWatch":
        return self

    def __exit__(self, *_: object) -> None:
        self._closed = True
        os.eventfd_write(self._end, 1)
        self._resume.set()
        self._thread.join()
        self._selector.unregister(self._end)
        os.close(self._end)
