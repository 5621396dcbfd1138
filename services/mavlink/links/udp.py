"""UDP: to a ground station that waits on a port, or on a port of our own for whoever comes."""

import socket
import time
from selectors import EVENT_READ, BaseSelector
from typing import ClassVar

from services.mavlink.adapter import Adapter
from services.mavlink.client import Client
from services.mavlink.links.link import PIECE, ROUND, Link, endpoint, is_local

MOST_CLIENTS = 8
SILENT = 10.0  # [s] of wall time after which a partner makes room for another

Address = tuple[str, int]


class _Udp(Link):
    """A socket, and the partners by their addresses."""

    def __init__(self, rest: str, adapter: Adapter, selector: BaseSelector):
        super().__init__(rest, adapter, selector)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setblocking(False)
        self.clients: dict[Address, Client] = {}
        self.heard: dict[Address, float] = {}
        selector.register(self.socket, EVENT_READ, self.read)

    def meet(self, address: Address) -> Client:
        """A partner at a new address."""

        def put(data: bytes) -> None:
            try:
                self.socket.sendto(data, address)
            except OSError:  # nobody listens there now, or the way is full: UDP may lose what it likes
                self.adapter.counts["not sent"] += 1

        return self.adapter.connect(is_local(address[0]), True, put)

    def read(self) -> None:
        """Take what has come, within bounds."""
        for _ in range(ROUND):
            try:
                data, address = self.socket.recvfrom(PIECE)
            except BlockingIOError:
                return
            except OSError:  # the answer to something sent where nobody listens
                continue
            if self.affords():
                self.hear(address, data)

    def hear(self, address: Address, data: bytes) -> None:
        """A datagram of somebody."""
        raise NotImplementedError

    def close(self) -> None:
        """Close the socket."""
        self.selector.unregister(self.socket)
        self.socket.close()


class UdpOut(_Udp):
    """To one partner, who need not have spoken."""

    SCHEME: ClassVar[str] = "udpout"
    FORM: ClassVar[str] = "udpout:HOST:PORT"

    def __init__(self, rest: str, adapter: Adapter, selector: BaseSelector):
        super().__init__(rest, adapter, selector)
        address = endpoint(rest)
        self.clients[address] = self.meet(address)

    def hear(self, address: Address, data: bytes) -> None:
        """Only the partner is listened to."""
        client = self.clients.get(address)
        if client:
            self.adapter.receive(client, data)
        else:
            self.adapter.counts["from a stranger"] += 1


class UdpIn(_Udp):
    """On a port of our own: whoever says something sensible there is a partner."""

    SCHEME: ClassVar[str] = "udpin"
    FORM: ClassVar[str] = "udpin:HOST:PORT"

    def __init__(self, rest: str, adapter: Adapter, selector: BaseSelector):
        super().__init__(rest, adapter, selector)
        try:
            self.socket.bind(endpoint(rest))
        except OSError:
            self.close()
            raise

    def hear(self, address: Address, data: bytes) -> None:
        """A partner is known by its address, and met at its first sound message."""
        client = self.clients.get(address)
        now = time.monotonic()
        if client is None:
            if not self._room(now):
                self.adapter.counts["no room for another client"] += 1
                return
            client = self.meet(address)
            if not self.adapter.receive(client, data):
                self.adapter.disconnect(client)
                return
            self.clients[address] = client
        else:
            self.adapter.receive(client, data)
        self.heard[address] = now

    def _room(self, now: float) -> bool:
        if len(self.clients) < MOST_CLIENTS:
            return True
        oldest = min(self.heard, key=self.heard.__getitem__)
        if now - self.heard[oldest] < SILENT:
            return False
        self.adapter.disconnect(self.clients.pop(oldest))
        del self.heard[oldest]
        return True
