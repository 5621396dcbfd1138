"""Non-blocking transports of a firmware's MAVLink link: UDP, where the firmware sends first, and TCP."""

import contextlib
import socket
import time

PIECE = 65536  # [bytes] most that one call reads
CONNECT_TIMEOUT, ATTEMPT_EVERY = 0.2, 0.5  # [s] duration of one attempt, and between two


class UdpTransport:
    """Socket on the port to which the firmware sends; answers go to the address of the last datagram."""

    def __init__(self, bound: socket.socket):
        """Use a bound socket."""
        self._socket, self._peer = bound, None
        self._socket.setblocking(False)

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
        self._address = (host, port)
        self._socket: socket.socket | None = None
        self._next = 0.0  # [s] wall time of the next attempt

    def receive(self) -> bytes:
        """Return the bytes that have arrived since the last call; connect first if there is no connection."""
        result = b""
        try:
            if self._socket is None:
                if time.monotonic() < self._next:
                    return b""
                self._next = time.monotonic() + ATTEMPT_EVERY
                self._socket = socket.create_connection(self._address, timeout=CONNECT_TIMEOUT)
                self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self._socket.setblocking(False)
            while part := self._socket.recv(PIECE):
                result += part
        except BlockingIOError:
            return result
        except OSError:
            pass
        self.close()  # no connection, or the end of the stream
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


Transport = UdpTransport | TcpTransport
