"""Subscription: a queue of messages that rejects those of a wrong sender."""

import queue
from collections.abc import Callable
from typing import Any

Message = tuple[int, bytes, bytes]
"""Simulation time [ns], GID of the sender (16 bytes) and payload."""


class Subscription:
    """Queue of messages, which a thread of the bus fills.

    Attributes:
        arrive: keeps a sample of the bus, which has its `key_expr`; called by a thread of the bus.
    """

    def __init__(
        self,
        read: Callable[[Any], Message | None],
        senders: dict[str, bytes | None] | None,
        on_rejected: Callable[[], None],
        deferred: bool = False,
    ):
        """Create an empty queue.

        Args:
            read: returns the message of a sample, None if it is invalid.
            senders: see `ZenohBus.receive`; None to accept all senders.
            on_rejected: called for each rejected message.
            deferred: read a sample when it is taken, not on arrival. The thread of the bus then runs no Python code,
                which costs more than half as much as the rest of the delivery. For messages that are taken soon: each
                keeps 64 kB of memory alive.
        """
        self._read, self._senders, self._on_rejected = read, senders, on_rejected
        # with one known sender its GID is enough: converting the key of a message to text takes most of the time
        self._only_key = next(iter(senders)) if senders and len(senders) == 1 and all(senders.values()) else None
        self._arrived: queue.SimpleQueue[Any] = queue.SimpleQueue()  # samples if deferred, else keys and messages
        self._deferred = deferred
        self.arrive: Callable[[Any], None] = self._arrived.put if deferred else self._arrive

    def get(self, timeout: float) -> tuple[int, bytes] | None:
        """Return simulation time [ns] and payload of the next message, None after `timeout` seconds."""
        result = self.get_with_key(timeout)
        return result and result[1:]

    def get_with_key(self, timeout: float) -> tuple[str, int, bytes] | None:
        """Return key, simulation time [ns] and payload of the next message.

        Return None after `timeout` seconds, or after `wake`.
        """
        try:
            while True:
                item = self._arrived.get(timeout=timeout)
                if item is None or not self._deferred or (item := self._accept(item)) is not None:
                    return item
        except queue.Empty:
            return None

    @property
    def pending(self) -> int:
        """Number of messages that have arrived and are not read; some of them may be rejected later."""
        return self._arrived.qsize()

    def wake(self) -> None:
        """End the current wait, or the next one; may be called from any thread."""
        self._arrived.put(None)

    def _arrive(self, sample: Any) -> None:
        message = self._accept(sample)
        if message is not None:
            self._arrived.put(message)

    def _accept(self, sample: Any) -> tuple[str, int, bytes] | None:
        """Return key, simulation time [ns] and payload of a sample. Return None if it is rejected."""
        message = self._read(sample)
        key = self._only_key or str(sample.key_expr)
        if message is None or not self._has_expected_sender(key, message[1]):
            self._on_rejected()
            return None
        return key, message[0], message[2]

    def _has_expected_sender(self, key: str, gid: bytes) -> bool:
        if self._senders is None:
            return True
        expected = self._senders.get(key, b"")
        if expected is None:
            expected = self._senders[key] = gid
        return expected == gid
