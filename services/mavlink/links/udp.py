"""UDP links: to one listening ground station, or listening on a port for any endpoint."""

import socket
import time
from selectors import EVENT_READ, BaseSelector
from typing import ClassVar

from lapwing.services.common.address import is_loopback
from lapwing.services.mavlink.links.link import MAX_ENDPOINTS, PIECE, ROUND, Endpoint, Link, Receiver, socket_address

SILENT = 10.0  # [s] of wall time without a message after which another endpoint may replace it

Address = tuple[str, int]


class _Udp(Link):
    """UDP socket, and its endpoints by address."""

    def __init__(self, rest: str, adapter: Receiver, selector: BaseSelector):
        super().__init__(rest, adapter, selector)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setblocking(False)
        self.endpoints: dict[Address, Endpoint] = {}
        self.last_received: dict[Address, float] = {}
        selector.register(self.socket, EVENT_READ, self.read)

    def connect(self, address: Address) -> Endpoint:
        """Return a new endpoint at an address."""

        def put(data: bytes) -> None:
            try:
                self.socket.sendto(data, address)
            except OSError:  # no listener, or a full buffer: UDP may lose messages
                self.adapter.counts["not sent"] += 1

        return self.adapter.connect(is_loopback(address[0]), True, put, strict=True)

    def read(self) -> None:
        """Read the received datagrams, at most `ROUND`."""
        for _ in range(ROUND):
            try:
                data, address = self.socket.recvfrom(PIECE)
            except BlockingIOError:
                return
            except OSError:  # the reply to a message without a listener
                continue
            if self.may_read():
                self.receive(address, data)

    def receive(self, address: Address, data: bytes) -> None:
        """Handle a datagram from an address."""
        raise NotImplementedError

    def close(self) -> None:
        """Close the socket."""
        self.selector.unregister(self.socket)
        self.socket.close()


class UdpOut(_Udp):
    """Link to one UDP endpoint, which may be silent."""

    SCHEME: ClassVar[str] = "udpout"
    FORM: ClassVar[str] = "udpout:HOST:PORT"

    def __init__(self, rest: str, adapter: Receiver, selector: BaseSelector):
        super().__init__(rest, adapter, selector)
        address = socket_address(rest)
        self.endpoints[address] = self.connect(address)

    def receive(self, address: Address, data: bytes) -> None:
        """Handle a datagram of the endpoint of this link; count those of others."""
        endpoint = self.endpoints.get(address)
        if endpoint:
            self.adapter.receive(endpoint, data)
        else:
            self.adapter.counts["from another address"] += 1


class UdpIn(_Udp):
    """Link that listens on a UDP port: every sender of a valid message is an endpoint."""

    SCHEME: ClassVar[str] = "udpin"
    FORM: ClassVar[str] = "udpin:HOST:PORT"
    LISTENS: ClassVar[bool] = True

    def __init__(self, rest: str, adapter: Receiver, selector: BaseSelector):
        super().__init__(rest, adapter, selector)
        try:
            self.socket.bind(socket_address(rest))
        except OSError:
            self.close()
            raise

    def receive(self, address: Address, data: bytes) -> None:
        """Handle a datagram; a new address becomes an endpoint at its first valid message."""
        endpoint = self.endpoints.get(address)
        now = time.monotonic()
        if endpoint is None:
            if not self._make_room(now):
                self.adapter.counts["too many endpoints"] += 1
                return
            endpoint = self.connect(address)
            if not self.adapter.receive(endpoint, data):
                self.adapter.disconnect(endpoint)
                return
            self.endpoints[address] = endpoint
        else:
            self.adapter.receive(endpoint, data)
        self.last_received[address] = now

    def _make_room(self, now: float) -> bool:
        if len(self.endpoints) < MAX_ENDPOINTS:
            return True
        oldest = min(self.last_received, key=self.last_received.__getitem__)
        if now - self.last_received[oldest] < SILENT:
            return False
        self.adapter.disconnect(self.endpoints.pop(oldest))
        del self.last_received[oldest]
        return True
