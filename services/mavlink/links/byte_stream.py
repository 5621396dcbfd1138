"""Links by byte streams: TCP and serial lines."""

import os
import re
import socket
import termios
import tty
from collections.abc import Callable
from selectors import EVENT_READ, BaseSelector
from typing import ClassVar

from lapwing.services.common.address import is_loopback
from lapwing.services.mavlink.links.link import MAX_ENDPOINTS, PIECE, ROUND, Link, Receiver, socket_address

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


class TcpIn(Link):
    """Listening socket and its connections."""

    SCHEME: ClassVar[str] = "tcpin"
    FORM: ClassVar[str] = "tcpin:HOST:PORT"
    LISTENS: ClassVar[bool] = True

    def __init__(self, rest: str, adapter: Receiver, selector: BaseSelector):
        super().__init__(rest, adapter, selector)
        self._server = socket.create_server(socket_address(rest))
        self._server.setblocking(False)
        self._streams: dict[socket.socket, ByteStream] = {}
        selector.register(self._server, EVENT_READ, self._accept)

    def _accept(self) -> None:
        try:
            connection, address = self._server.accept()
        except OSError:  # the client has disconnected
            return
        if len(self._streams) >= MAX_ENDPOINTS:
            self.adapter.counts["too many endpoints"] += 1
            connection.close()
            return
        connection.setblocking(False)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

        def on_end() -> None:
            del self._streams[connection]
            connection.close()

        self._streams[connection] = ByteStream(
            connection.fileno(),
            is_loopback(address[0]),
            self.adapter,
            self.selector,
            self.may_read,
            on_end,
            strict=True,
        )

    def close(self) -> None:
        """Close the server and every connection."""
        for connection, stream in self._streams.items():
            stream.end()
            connection.close()
        self.selector.unregister(self._server)
        self._server.close()


class Serial(Link):
    """A character device in raw mode."""

    SCHEME: ClassVar[str] = "serial"
    FORM: ClassVar[str] = "serial:DEVICE:BAUD"

    @classmethod
    def for_vehicle_index(cls, rest: str, i: int) -> str:
        """Return the rest of the URL. Raise ValueError for a second vehicle."""
        if i:
            raise ValueError(f"serial:{rest}: serves one vehicle; expected udpout, udpin or tcpin")
        return rest

    def __init__(self, rest: str, adapter: Receiver, selector: BaseSelector):
        super().__init__(rest, adapter, selector)
        path, _, baud = rest.rpartition(":")
        self._descriptor = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            tty.setraw(self._descriptor)
            settings = termios.tcgetattr(self._descriptor)
            settings[4] = settings[5] = getattr(termios, f"B{baud}")
            termios.tcsetattr(self._descriptor, termios.TCSANOW, settings)
        except termios.error as error:
            os.close(self._descriptor)
            raise OSError(error.args[0], "is not a serial line") from None
        self._stream: ByteStream | None = ByteStream(
            self._descriptor, False, adapter, selector, self.may_read, self._on_end
        )

    @staticmethod
    def fits(rest: str) -> bool:
        """Return True for a device and a baud rate that the system supports."""
        match = re.fullmatch(r"/.+:(\d+)", rest, re.ASCII)
        return match is not None and hasattr(termios, f"B{match[1]}")

    def _on_end(self) -> None:
        self._stream = None
        os.close(self._descriptor)

    def close(self) -> None:
        """Close the device."""
        if self._stream:
            self._stream.end()
            self._on_end()
