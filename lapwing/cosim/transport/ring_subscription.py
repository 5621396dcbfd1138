"""Ring-buffer subscription to one sender on one key; Zenoh itself holds the messages.

Zenoh's thread runs no Python for such a message and waits for no lock of Python's
(docs/explanation/decisions/0018-inboxes.md).
"""

import time
from collections.abc import Callable
from typing import Any

from lapwing.cosim.transport.subscription import Message


class Inbox:
    """Messages in order of arrival; what is not of the sender is left out. For one thread.

    Attributes:
        until: when `get` has waited long enough, on the monotonic clock; infinite while no thread waits.
    """

    def __init__(
        self,
        receive: Callable[[], Any],
        read: Callable[[Any], Message | None],
        sender: bytes | None,
        waker: bytes,
        refuse: Callable[[], None],
    ):
        """Without a message.

        Args:
            receive: waits for the next sample of the bus, however long that takes.
            read: what a sample says, None where it is no message.
            sender: the gid that a message must carry, None for that of the first.
            waker: the gid of a message that says that `until` has passed.
            refuse: called for each message that is left out.
        """
        self._receive, self._read, self._refuse = receive, read, refuse
        self._sender, self._waker = sender, waker
        self.until = float("inf")

    def get(self, timeout: float) -> tuple[int, bytes] | None:
        """Return simulation time [ns] and payload of the next message, None after about `timeout` seconds."""
        until = self.until = time.monotonic() + timeout
        try:
            while True:
                message = self._read(self._receive())
                if message is None:
                    self._refuse()
                    continue
                time_ns, gid, payload = message
                if gid == self._sender:
                    return time_ns, payload
                if gid == self._waker:
                    if time.monotonic() >= until:
                        return None
                elif self._sender is None:
                    self._sender = gid
                    return time_ns, payload
                else:
                    self._refuse()
        finally:
            self.until = float("inf")
