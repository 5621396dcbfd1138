"""UDP socket for compiled code and Python, which share the memory of its datagrams."""

import ctypes
import socket
import struct
from typing import Any, NamedTuple

import numpy as np

from lapwing.kernels import always_inline
from lapwing.kernels.native_calls import address_of, call_long
from lapwing.services.common.firmware.link import FirmwareError

SIZE = 2048  # [bytes] largest datagram
WAIT = 0.2  # [s] of one wait for a datagram
_ADDRESS = 16  # [bytes] of a `struct sockaddr_in`


class Datagrams(NamedTuple):
    """Memory and functions of a socket."""

    descriptor: Any  # (1,) int64
    sent: Any  # (SIZE,) bytes of the last message
    sent_size: Any  # (1,)
    received: Any  # (SIZE,) bytes of the last datagram
    peer: Any  # (2,) int64: address of the other end; 0: none
    sender: Any  # (2,) int64: address of the sender of the last datagram
    sender_size: Any  # (1,) int64
    addresses: tuple[int, ...]  # addresses of sent, received, peer, sender, sender_size
    sendto: int  # addresses of functions
    recvfrom: int


def datagrams() -> Datagrams:
    """Return the memory of a closed socket."""
    libc = ctypes.CDLL(None)
    sent, received = np.zeros(SIZE, np.uint8), np.zeros(SIZE, np.uint8)
    peer, sender, size = np.zeros(2, np.int64), np.zeros(2, np.int64), np.zeros(1, np.int64)
    addresses = [part.ctypes.data for part in (sent, received, peer, sender, size)]
    return Datagrams(
        np.full(1, -1), sent, np.zeros(1, np.int64), received, peer, sender, size, tuple(addresses),
        address_of(libc.sendto), address_of(libc.recvfrom),
    )  # fmt: skip


@always_inline
def send(d: Datagrams) -> bool:
    """Send the message to the other end. Return True if it was sent."""
    address = d.addresses[0], d.addresses[2]
    size = d.sent_size[0]
    return call_long(d.sendto, (d.descriptor[0], address[0], size, 0, address[1], _ADDRESS)) == size


@always_inline
def receive(d: Datagrams) -> int:
    """Wait for a datagram at most 0.2 s. Return its size [bytes], negative if none has arrived."""
    d.sender_size[0] = _ADDRESS
    return call_long(d.recvfrom, (d.descriptor[0], d.addresses[1], SIZE, 0, d.addresses[3], d.addresses[4]))


@always_inline
def is_from_peer(d: Datagrams) -> bool:
    """True if the last datagram comes from the other end."""
    return d.sender[0] == d.peer[0] and d.sender[1] == d.peer[1]


@always_inline
def unsigned16(data: Any, at: int) -> int:
    """Return the number of two bytes, the lower one first."""
    return int(data[at]) | int(data[at + 1]) << 8


class DatagramSocket:
    """Python interface of the socket.

    Attributes:
        memory: memory shared with compiled code.
    """

    def __init__(self) -> None:
        """Create the memory without a socket."""
        self.memory = datagrams()
        self._socket: socket.socket | None = None
        self._recvfrom: Any = ctypes.CDLL(None).recvfrom
        self._recvfrom.restype = ctypes.c_ssize_t

    def attach(self, bound: socket.socket) -> None:
        """Use a bound socket; a receive call ends after 0.2 s."""
        bound.setblocking(True)
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, timeval(WAIT))
        self._socket, self.memory.descriptor[0] = bound, bound.fileno()

    def close(self) -> None:
        """Close the socket."""
        self.memory.descriptor[0] = -1
        if self._socket:
            self._socket.close()
        self._socket = None

    def send(self) -> str:
        """Send the message to the other end. Return the reason of a failure, "" otherwise."""
        if self._socket and self.has_peer and self.memory.sent_size[0]:
            try:
                self._socket.sendto(self.memory.sent[: self.memory.sent_size[0]], _host_and_port(self.memory.peer))
            except OSError as error:
                return str(error.strerror)
        return ""

    def receive(self) -> int:
        """Wait for a datagram at most 0.2 s. Return its size [bytes], negative if none has arrived."""
        d = self.memory
        d.sender_size[0] = _ADDRESS
        pointers = [ctypes.c_void_p(place) for place in d.addresses]
        descriptor = ctypes.c_int(int(d.descriptor[0]))
        return int(self._recvfrom(descriptor, pointers[1], ctypes.c_size_t(SIZE), 0, pointers[3], pointers[4]))

    def datagram(self, size: int) -> bytes:
        """Return the last datagram, of `size` bytes."""
        return self.memory.received[:size].tobytes()

    @property
    def sender(self) -> str:
        """Sender of the last datagram, HOST:PORT."""
        return "{}:{}".format(*_host_and_port(self.memory.sender))

    @property
    def has_peer(self) -> bool:
        """True if the other end is known."""
        return bool(self.memory.peer[0])

    @property
    def knows_sender(self) -> bool:
        """True if the last datagram comes from the other end."""
        return bool((self.memory.sender == self.memory.peer).all())

    def answer_sender(self) -> None:
        """Make the sender of the last datagram the other end."""
        self.memory.peer[:] = self.memory.sender


def bound_socket(firmware: str, host: str, port: int, advice: str) -> socket.socket:
    """Return a UDP socket that is bound to a port.

    Raises:
        FirmwareError: the port is in use; the text ends with `advice`.
    """
    result = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        result.bind((host, port))
    except OSError as error:
        result.close()
        raise FirmwareError(f"{firmware}: cannot listen on udp {host}:{port} ({error.strerror}); {advice}") from None
    return result


def timeval(seconds: float) -> bytes:
    """Return a duration as `struct timeval`."""
    return struct.pack("@ll", *divmod(round(seconds * 1e6), 1_000_000))


def _host_and_port(address: np.ndarray) -> tuple[str, int]:
    data = address.tobytes()
    return socket.inet_ntoa(data[4:8]), int.from_bytes(data[2:4], "big")
