"""What has arrived on some keys and was not taken yet; who takes it leaves out what is not of its sender."""

import queue
import time
from collections.abc import Callable
from typing import Any

Message = tuple[int, bytes, bytes]
"""Simulation time [ns], mark of the sender (16 bytes) and payload."""


class Subscription:
    """Samples that a thread of the bus puts into a queue, as the messages that they are."""

    def __init__(
        self,
        arrived: queue.SimpleQueue,
        read: Callable[[Any], Message | None],
        senders: dict[str, bytes | None] | None,
        refuse: Callable[[], None],
    ):
        """Of the samples in `arrived`.

        Args:
            arrived: samples of the bus, each with its `key_expr`.
            read: what a sample says, None where it is no message.
            senders: as of `ZenohBus.receive`, None for anybody.
            refuse: called for each that is not taken.
        """
        self._arrived, self._read, self._senders, self._refuse = arrived, read, senders, refuse
        self._only_mark = next(iter(senders.values())) if senders and len(senders) == 1 else None

    def get(self, timeout: float) -> tuple[int, bytes] | None:
        """Simulation time [ns] and payload of the next message, None after `timeout` seconds."""
        found = self._next(timeout)
        return found and found[1:]

    def get_with_key(self, timeout: float) -> tuple[str, int, bytes] | None:
        """The same with the message's key in front."""
        found = self._next(timeout)
        return found and (str(found[0].key_expr), *found[1:])

    def _next(self, timeout: float) -> tuple[Any, int, bytes] | None:
        """The next sample of its sender, its time and its payload."""
        until = None
        while True:
            try:
                sample = self._arrived.get(timeout=timeout)
            except queue.Empty:
                return None
            message = self._read(sample)
            if message is not None and self._is_of_its_sender(sample, message[1]):
                return sample, message[0], message[2]
            self._refuse()
            until = until or time.monotonic() + timeout
            timeout = max(0.0, until - time.monotonic())

    def _is_of_its_sender(self, sample: Any, mark: bytes) -> bool:
        if self._only_mark or self._senders is None:  # the text of a key takes longer than all else
            return self._only_mark in (None, mark)
        key = str(sample.key_expr)
        expected = self._senders.get(key, b"")
        if expected is None:
            expected = self._senders[key] = mark
        return expected == mark
