"""How long what a process publishes waits for room on its way: Zenoh waits for a link that takes nothing."""

import math
import threading
import time
from collections.abc import Callable

LOOK = 0.2  # [s] between two looks


class PublishWatchdog:
    """Says from a thread of its own that a message finds no room, since the thread that publishes it stands still.

    Whoever watches the run then names the one who takes nothing, and not the one who waits for it.
    """

    def __init__(self, say: Callable[[], None], patience: float):
        """Call `say` each time when what is done within this context has taken `patience` [s] more."""
        self._say, self._patience = say, patience
        self._begun = self._said = math.inf  # [s] of the monotonic clock; infinite while nothing is published
        self._closed = threading.Event()
        threading.Thread(target=self._watch, daemon=True).start()

    def __enter__(self) -> None:
        self._begun = time.monotonic()

    def __exit__(self, *_: object) -> None:
        self._begun = math.inf

    def close(self) -> None:
        """Watch no longer."""
        self._closed.set()

    def _watch(self) -> None:
        while not self._closed.wait(LOOK):
            begun, now = self._begun, time.monotonic()
            if now - begun < self._patience:
                self._said = -math.inf
            elif now - self._said >= self._patience:
                self._said = now
                self._say()
