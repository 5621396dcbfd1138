"""Subscriptions: queues of messages that reject those of a wrong sender.

Zenoh itself holds the messages of an `Inbox`: its thread runs no Python for them and waits for no lock of Python
(docs/explanation/decisions/0018-inboxes.md).
"""

import queue
import time
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


class Inbox:
    """Queue of the messages of one sender, in order of arrival; for one reading thread.

    Attributes:
        deadline: end of the wait in `get` [s], on the monotonic clock; infinite while no thread waits.
    """

    def __init__(
        self,
        receive: Callable[[], Any],
        read: Callable[[Any], Message | None],
        sender: bytes | None,
        waker: bytes,
        on_rejected: Callable[[], None],
    ):
        """Create an empty queue.

        Args:
            receive: waits for the next sample of the bus without a time-out.
            read: returns the message of a sample, None if it is invalid.
            sender: required GID of the messages; None for that of the first message.
            waker: GID of the message that announces that `deadline` has passed.
            on_rejected: called for each rejected message.
        """
        self._receive, self._read, self._on_rejected = receive, read, on_rejected
        self._sender, self._waker = sender, waker
        self.deadline = float("inf")

    def get(self, timeout: float) -> tuple[int, bytes] | None:
        """Return simulation time [ns] and payload of the next message, None after about `timeout` seconds."""
        deadline = self.deadline = time.monotonic() + timeout
        try:
            while True:
                message = self._read(self._receive())
                if message is None:
                    self._on_rejected()
                    continue
                time_ns, gid, payload = message
                if gid == self._sender:
                    return time_ns, payload
                if gid == self._waker:
                    if time.monotonic() >= deadline:
                        return None
                elif self._sender is None:
                    self._sender = gid
                    return time_ns, payload
                else:
                    self._on_rejected()
        finally:
            self.deadline = float("inf")
