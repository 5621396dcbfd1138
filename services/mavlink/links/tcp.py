"""TCP: a server that clients connect to."""

import socket
from selectors import EVENT_READ, BaseSelector
from typing import ClassVar

from lapwing.services.common.address import is_loopback
from lapwing.services.mavlink.adapter import Adapter
from lapwing.services.mavlink.links.byte_stream import ByteStream
from lapwing.services.mavlink.links.link import Link, next_port, socket_address

MAX_ENDPOINTS = 8


class TcpIn(Link):
    """A listening socket and those who have come."""

    SCHEME: ClassVar[str] = "tcpin"
    FORM: ClassVar[str] = "tcpin:HOST:PORT"

    @classmethod
    def for_vehicle_index(cls, rest: str, i: int) -> str:
        """Return the rest of the URL with the port of vehicle i (from 0)."""
        return next_port(rest, i)

    def __init__(self, rest: str, adapter: Adapter, selector: BaseSelector):
        super().__init__(rest, adapter, selector)
        self._server = socket.create_server(socket_address(rest))
        self._server.setblocking(False)
        self._streams: dict[socket.socket, ByteStream] = {}
        selector.register(self._server, EVENT_READ, self._accept)

    def _accept(self) -> None:
        try:
            connection, address = self._server.accept()
        except OSError:  # gone again meanwhile
            return
        if len(self._streams) >= MAX_ENDPOINTS:
            self.adapter.counts["no room for another endpoint"] += 1
            connection.close()
            return
        connection.setblocking(False)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

        def gone() -> None:
            del self._streams[connection]
            connection.close()

        self._streams[connection] = ByteStream(
            connection.fileno(), is_loopback(address[0]), self.adapter, self.selector, self.affords, gone, strict=True
        )

    def close(self) -> None:
        """Close the server and every connection."""
        for connection, stream in self._streams.items():
            stream.end()
            connection.close()
        self.selector.unregister(self._server)
        self._server.close()
