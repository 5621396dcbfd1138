"""Non-blocking transports of a firmware's MAVLink link: UDP, where the firmware sends first, and TCP."""

import contextlib
import socket
import time
from typing import Protocol

PIECE = 65536  # [bytes] most that one call reads
CONNECT_TIMEOUT, ATTEMPT_EVERY = 0.2, 0.5  # [s] duration of one attempt, and between two


class Transport(Protocol):
    """Connection to the MAVLink link of a firmware."""

    where: str  # address, for messages

    def receive(self) -> bytes:
        """Return the bytes that have arrived since the last call."""

    def send(self, data: bytes) -> None:
        """Send bytes; they are lost while there is no connection."""

    def close(self) -> None:
        """Close the connection."""


class UdpTransport:
    """Socket on the port to which the firmware sends; answers go to the address of the last datagram."""

    def __init__(self, host: str, port: int):
        """Open the socket. Raise OSError if the port is in use."""
        self.where = f"udp {host}:{port}"
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((host, port))
        except OSError:
            self._socket.close()
            raise
        self._socket.setblocking(False)
        self._peer: tuple[str, int] | None = None

    def receive(self) -> bytes:
        """Return the bytes that have arrived since the last call."""
        result = b""
        with contextlib.suppress(OSError):
            while True:
                data, self._peer = self._socket.recvfrom(PIECE)
                result += data
        return result

    def send(self, data: bytes) -> None:
        """Send a datagram to the firmware, if it has sent one."""
        if self._peer:
            with contextlib.suppress(OSError):
                self._socket.sendto(data, self._peer)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


class TcpTransport:
    """Client of a firmware's TCP port; reconnects after the connection is lost."""

    def __init__(self, host: str, port: int):
        """Store the address; `receive` connects."""
        self.where = f"tcp {host}:{port}"
        self._address = (host, port)
        self._socket: socket.socket | None = None
        self._next = 0.0  # [s] wall time of the next attempt

    def receive(self) -> bytes:
        """Return the bytes that have arrived since the last call; connect first if there is no connection."""
        if self._socket is None:
            if time.monotonic() < self._next:
                return b""
            self._next = time.monotonic() + ATTEMPT_EVERY
            try:
                self._socket = socket.create_connection(self._address, timeout=CONNECT_TIMEOUT)
            except OSError:
                return b""
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._socket.setblocking(False)
        result = b""
        try:
            while part := self._socket.recv(PIECE):
                result += part
        except BlockingIOError:
            return result
        except OSError:
            pass
        self.close()  # the end of the stream
        return result

    def send(self, data: bytes) -> None:
        """Send bytes, if there is a connection."""
        if self._socket is not None:
            try:
                self._socket.sendall(data)
            except OSError:
                self.close()

    def close(self) -> None:
        """Close the connection."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None
