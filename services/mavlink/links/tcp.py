"""TCP: a server that clients connect to."""

import socket
from selectors import EVENT_READ, BaseSelector
from typing import ClassVar

from lapwing.services.common.address import is_loopback
from lapwing.services.mavlink.links.byte_stream import ByteStream
from lapwing.services.mavlink.links.link import MAX_ENDPOINTS, Link, socket_address
from lapwing.services.mavlink.links.receiver import Receiver


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
