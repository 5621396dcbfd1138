"""Subscription: a queue of messages that rejects those of a wrong sender."""

import queue
from collections.abc import Callable
from typing import Any

Message = tuple[int, bytes, bytes]
"""Simulation time [ns], GID of the sender (16 bytes) and payload."""


class Subscription:
    """Queue of messages, which a thread of the bus fills."""

    def __init__(
        self,
        read: Callable[[Any], Message | None],
        senders: dict[str, bytes | None] | None,
        on_rejected: Callable[[], None],
        notify: Callable[[], None] | None = None,
    ):
        """Create an empty queue.

        Args:
            read: returns the message of a sample, None if it is invalid.
            senders: see `ZenohBus.receive`; None to accept all senders.
            on_rejected: called for each rejected message.
            notify: called after each arrival.
        """
        self._read, self._senders, self._on_rejected, self._notify = read, senders, on_rejected, notify
        # with one known sender its GID is enough: converting the key of a message to text takes most of the time
        self._only_key = next(iter(senders)) if senders and len(senders) == 1 and all(senders.values()) else None
        self._arrived: queue.SimpleQueue[tuple[str, int, bytes]] = queue.SimpleQueue()

    def get(self, timeout: float) -> tuple[int, bytes] | None:
        """Return simulation time [ns] and payload of the next message, None after `timeout` seconds."""
        result = self.get_with_key(timeout)
        return result and result[1:]

    def get_with_key(self, timeout: float) -> tuple[str, int, bytes] | None:
        """Return key, simulation time [ns] and payload of the next message, None after `timeout` seconds."""
        try:
            return self._arrived.get(timeout=timeout)
        except queue.Empty:
            return None

    def arrive(self, sample: Any) -> None:
        """Keep a sample of the bus, which has its `key_expr`; called by a thread of the bus."""
        message = self._read(sample)
        key = self._only_key or str(sample.key_expr)
        if message is None or not self._has_expected_sender(key, message[1]):
            self._on_rejected()
            return
        self._arrived.put((key, message[0], message[2]))
        if self._notify:
            self._notify()

    def _has_expected_sender(self, key: str, gid: bytes) -> bool:
        if self._senders is None:
            return True
        expected = self._senders.get(key, b"")
        if expected is None:
            expected = self._senders[key] = gid
        return expected == gid
