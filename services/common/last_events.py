"""End of the event topics, which the launcher publishes after the flight and viewers wait for."""

import time
from collections.abc import Iterable

PATIENCE = 3.0  # [s] after the end of the flight; a run without a launcher has no events


class LastEvents:
    """Event keys whose end has not arrived."""

    def __init__(self, keys: Iterable[str]):
        """Wait for the end of each key."""
        self._open = set(keys)
        self._deadline: float | None = None

    def end(self, key: str) -> None:
        """Process an empty message, which ends a key."""
        self._open.discard(key)

    def await_more(self, flying: bool) -> bool:
        """Return True while messages are expected; `flying` is True until every service has ended."""
        if flying:
            return True
        self._deadline = self._deadline or time.monotonic() + PATIENCE
        return bool(self._open) and time.monotonic() < self._deadline
