"""An endpoint behind a stream of bytes, whose end may be slow to take what is sent."""

import os
from collections.abc import Callable
from selectors import EVENT_READ, BaseSelector

from lapwing.services.mavlink.adapter import Adapter
from lapwing.services.mavlink.links.link import PIECE, ROUND

MAX_PENDING = 256 * 1024  # [bytes] kept for an endpoint that does not take them; more, and it is dropped


class ByteStream:
    """A non-blocking file descriptor and the endpoint behind it."""

    def __init__(
        self,
        descriptor: int,
        local: bool,
        adapter: Adapter,
        selector: BaseSelector,
        affords: Callable[[], bool],
        gone: Callable[[], None],
        strict: bool = False,
    ):
        """Register the descriptor.

        Args:
            descriptor: non-blocking.
            local: its other end is on this machine.
            adapter: of the vehicle.
            selector: that waits for it.
            affords: returns True if one more piece may be read.
            gone: called when the stream has ended.
            strict: end the stream if its first bytes are not MAVLink.
        """
        self._descriptor, self._adapter, self._selector = descriptor, adapter, selector
        self._affords, self._gone = affords, gone
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
        """Take what has come, within bounds."""
        for _ in range(ROUND):
            try:
                data = b"" if self._broken else os.read(self._descriptor, PIECE)
            except BlockingIOError:
                return
            except OSError:
                data = b""
            if not data:
                self.end()
                self._gone()
                return
            if self._affords():
                self._adapter.receive(self._endpoint, data)
                self._broken |= self._endpoint.foreign

    def end(self) -> None:
        """Forget the endpoint."""
        self._selector.unregister(self._descriptor)
        self._adapter.disconnect(self._endpoint)
