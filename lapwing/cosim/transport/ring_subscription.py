"""Ring-buffer subscription to one sender on one key; Zenoh itself holds the messages.

Zenoh's thread runs no Python for such a message and waits for no lock of Python
(docs/explanation/decisions/0018-inboxes.md).
"""

import time
from collections.abc import Callable
from typing import Any

from lapwing.cosim.transport.subscription import Message


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
