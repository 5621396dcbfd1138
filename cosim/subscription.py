"""What has arrived on some keys and was not taken yet; what is not of its sender is left out."""

import queue
import time
from collections.abc import Callable
from typing import Any

Message = tuple[int, bytes, bytes]
"""Simulation time [ns], mark of the sender (16 bytes) and payload."""


class Subscription:
    """A queue of messages, which a thread of the bus fills.

    Attributes:
        arrive: what that thread calls with each sample of the bus, which has its `key_expr`.
    """

    def __init__(
        self,
        read: Callable[[Any], Message | None],
        senders: dict[str, bytes | None] | None,
        refuse: Callable[[], None],
        notify: Callable[[], None] | None = None,
        few: bool = False,
    ):
        """Without a message.

        Args:
            read: what a sample says, None where it is no message.
            senders: as of `ZenohBus.receive`, None for anybody.
            refuse: called for each message that is left out.
            notify: called after each arrival.
            few: as of `ZenohBus.receive`; without `notify`.
        """
        self._read, self._senders, self._refuse, self._notify = read, senders, refuse, notify
        self._only_mark = next(iter(senders.values())) if senders and len(senders) == 1 else None
        self._arrived: queue.SimpleQueue = queue.SimpleQueue()  # samples where there are few, else key, time, payload
        self._few = few
        self.arrive: Callable[[Any], None] = self._arrived.put if few else self._copy

    def get(self, timeout: float) -> tuple[int, bytes] | None:
        """Simulation time [ns] and payload of the next message, None after `timeout` seconds."""
        found = self._next(timeout)
        return found and found[1:]

    def get_with_key(self, timeout: float) -> tuple[str, int, bytes] | None:
        """The same with the message's key in front."""
        found = self._next(timeout)
        return found and (str(found[0]), *found[1:])

    def _next(self, timeout: float) -> tuple[Any, int, bytes] | None:
        """The next message of its sender: its key, its time and its payload."""
        until = None
        while True:
            try:
                found = self._arrived.get(timeout=timeout)
            except queue.Empty:
                return None
            if not self._few or (found := self._checked(found)):
                return found
            until = until or time.monotonic() + timeout
            timeout = max(0.0, until - time.monotonic())

    def _copy(self, sample: Any) -> None:
        if found := self._checked(sample):
            self._arrived.put((str(found[0]), *found[1:]))
            if self._notify:
                self._notify()

    def _checked(self, sample: Any) -> tuple[Any, int, bytes] | None:
        """Key, time and payload of a message of its sender; any other is refused."""
        message = self._read(sample)
        if message is None or not self._is_of_its_sender(sample, message[1]):
            self._refuse()
            return None
        return sample.key_expr, message[0], message[2]

    def _is_of_its_sender(self, sample: Any, mark: bytes) -> bool:
        if self._only_mark or self._senders is None:  # the text of a key takes longer than all else
            return self._only_mark in (None, mark)
        key = str(sample.key_expr)
        expected = self._senders.get(key, b"")
        if expected is None:
            expected = self._senders[key] = mark
        return expected == mark
