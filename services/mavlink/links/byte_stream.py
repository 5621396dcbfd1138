"""Endpoint behind a stream of bytes, which may be slow to read."""

import os
from collections.abc import Callable
from selectors import EVENT_READ, BaseSelector

from lapwing.services.mavlink.links.link import PIECE, ROUND
from lapwing.services.mavlink.links.receiver import Receiver

MAX_PENDING = 256 * 1024  # [bytes] of unread data, above which an endpoint is disconnected


class ByteStream:
    """Non-blocking file descriptor and the endpoint behind it."""

    def __init__(
        self,
        descriptor: int,
        local: bool,
        adapter: Receiver,
        selector: BaseSelector,
        may_read: Callable[[], bool],
        on_end: Callable[[], None],
        strict: bool = False,
    ):
        """Register the descriptor.

        Args:
            descriptor: non-blocking file descriptor.
            local: True if its other end is on this machine.
            adapter: adapter of the vehicle.
            selector: selector that waits for the descriptor.
            may_read: returns True if another piece may be read.
            on_end: called when the stream has ended.
            strict: True to end the stream if its first bytes are not MAVLink.
        """
        self._descriptor, self._adapter, self._selector = descriptor, adapter, selector
        self._may_read, self._on_end = may_read, on_end
        self._pending = bytearray()
        self._broken = False
        self._endpoint = adapter.connect(local, False, self._put, strict)
        selector.register(descriptor, EVENT_READ, self.read)

    def _put(self, data: bytes) -> None:
        if self._broken:
            return
        self._pending += data
        try:
            written = os.write(self._descriptor, self._pending)
            del self._pending[:written]
        except BlockingIOError:
            pass
        except OSError:
            self._broken = True
        if len(self._pending) > MAX_PENDING:
            self._adapter.counts["endpoint that does not read"] += 1
            self._broken = True

    def read(self) -> None:
        """Read the received bytes, at most `ROUND` pieces."""
        for _ in range(ROUND):
            try:
                data = b"" if self._broken else os.read(self._descriptor, PIECE)
            except BlockingIOError:
                return
            except OSError:
                data = b""
            if not data:
                self.end()
                self._on_end()
                return
            if self._may_read():
                self._adapter.receive(self._endpoint, data)
                self._broken |= self._endpoint.foreign

    def end(self) -> None:
        """Remove the endpoint."""
        self._selector.unregister(self._descriptor)
        self._adapter.disconnect(self._endpoint)
