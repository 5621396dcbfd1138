"""Socket for compiled code and Python, which share the memory of its messages."""

import ctypes
import errno
import os
import socket
import struct
from typing import Any, NamedTuple

import numpy as np

from lapwing.kernels import always_inline
from lapwing.kernels.native_calls import address_of, call_long

SIZE = 65536  # [bytes] most that one call sends or receives
WAIT = 0.2  # [s] of one wait for a message
CLOSED = 0  # size of a message at the end of a TCP connection
DO_NOT_WAIT = socket.MSG_DONTWAIT
_SEND_FLAGS = int(getattr(socket, "MSG_NOSIGNAL", 0) | DO_NOT_WAIT)  # Python ignores SIGPIPE anyway
_ADDRESS = 16  # [bytes] of a `struct sockaddr_in`
_OFFSET = 6  # [bytes] before the messages, so that the payload of a MAVLink frame is aligned


class Channel(NamedTuple):
    """Memory and functions of a socket."""

    descriptor: Any  # (1,) int64
    sent: Any  # (SIZE,) bytes of the last message
    sent_size: Any  # (1,)
    received: Any  # (SIZE,) bytes of the last message
    peer: Any  # (2,) int64: address of the other end; 0: none, or a TCP connection
    sender: Any  # (2,) int64: address of the sender of the last datagram
    sender_size: Any  # (1,) int64
    addresses: tuple[int, ...]  # addresses of sent, received, peer, sender, sender_size
    sendto: int  # addresses of functions
    recvfrom: int


_LIBC = ctypes.CDLL(None, use_errno=True)
for _function, _last in ((_LIBC.sendto, ctypes.c_size_t), (_LIBC.recvfrom, ctypes.c_void_p)):
    _function.restype = ctypes.c_ssize_t
    _function.argtypes = (ctypes.c_int, ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int, ctypes.c_void_p, _last)


def channel() -> Channel:
    """Return the memory of a closed socket."""
    sent, received = (np.zeros(_OFFSET + SIZE, np.uint8)[_OFFSET:] for _ in range(2))
    peer, sender, size = np.zeros(2, np.int64), np.zeros(2, np.int64), np.zeros(1, np.int64)
    addresses = [part.ctypes.data for part in (sent, received, peer, sender, size)]
    return Channel(
        np.full(1, -1), sent, np.zeros(1, np.int64), received, peer, sender, size, tuple(addresses),
        address_of(_LIBC.sendto), address_of(_LIBC.recvfrom),
    )  # fmt: skip


@always_inline
def send(c: Channel) -> bool:
    """Send the message to the other end. Return True if it was sent."""
    peer, size = c.addresses[2] if c.peer[0] != 0 else 0, c.sent_size[0]
    length = _ADDRESS if peer != 0 else 0
    return call_long(c.sendto, (c.descriptor[0], c.addresses[0], size, _SEND_FLAGS, peer, length)) == size


@always_inline
def receive(c: Channel) -> int:
    """Wait for a message at most 0.2 s. Return its size [bytes], negative if none has arrived."""
    c.sender_size[0] = _ADDRESS
    return call_long(c.recvfrom, (c.descriptor[0], c.addresses[1], SIZE, 0, c.addresses[3], c.addresses[4]))


@always_inline
def is_from_peer(c: Channel) -> bool:
    """True if the last datagram comes from the other end."""
    return c.sender[0] == c.peer[0] and c.sender[1] == c.peer[1]


class SharedSocket:
    """Python interface of the socket.

    Attributes:
        memory: memory shared with compiled code.
    """

    def __init__(self) -> None:
        """Create the memory without a socket."""
        self.memory = channel()
        self._socket: socket.socket | None = None

    @property
    def is_open(self) -> bool:
        """True while there is a socket."""
        return self._socket is not None

    def attach(self, opened: socket.socket) -> None:
        """Use a bound socket or a connection; a receive call ends after 0.2 s."""
        opened.setblocking(True)
        duration = struct.pack("@ll", *divmod(round(WAIT * 1e6), 1_000_000))  # struct timeval
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, duration)
        self._socket, self.memory.descriptor[0] = opened, opened.fileno()

    def close(self) -> None:
        """Close the socket."""
        self.memory.descriptor[0] = -1
        self.memory.peer[:] = 0
        if self._socket:
            self._socket.close()
        self._socket = None

    def send(self, data: bytes | None = None) -> str:
        """Send `data`, or the last message again. Return the reason of a failure, "" otherwise."""
        c = self.memory
        if data is not None:
            c.sent_size[0] = 0
            self.append(data)
        peer, size = c.addresses[2] if c.peer[0] else None, int(c.sent_size[0])
        length = _ADDRESS if peer else 0
        result = _LIBC.sendto(int(c.descriptor[0]), c.addresses[0], size, _SEND_FLAGS, peer, length)
        return "" if result == size else os.strerror(ctypes.get_errno())

    def append(self, data: bytes) -> None:
        """Append to the message that compiled code sends."""
        first = int(self.memory.sent_size[0])
        self.memory.sent_size[0] = stop = first + len(data)
        self.memory.sent[first:stop] = np.frombuffer(data, np.uint8)

    def receive(self, flags: int = 0) -> int:
        """Wait for a message at most 0.2 s. Return its size [bytes], CLOSED, or negative if none has arrived."""
        c = self.memory
        c.sender_size[0] = _ADDRESS
        size = _LIBC.recvfrom(int(c.descriptor[0]), c.addresses[1], SIZE, flags, c.addresses[3], c.addresses[4])
        lost = size < 0 and not c.peer[0] and ctypes.get_errno() not in (errno.EAGAIN, errno.EINTR)
        return CLOSED if lost else int(size)

    def data(self, size: int) -> bytes:
        """Return the last message, of `size` bytes."""
        return self.memory.received[:size].tobytes()

    @property
    def sender(self) -> str:
        """Sender of the last datagram, HOST:PORT."""
        return "{}:{}".format(*_host_and_port(self.memory.sender))

    @property
    def peer_port(self) -> int:
        """Port of the other end, 0 if it is not known."""
        return _host_and_port(self.memory.peer)[1]

    @property
    def knows_sender(self) -> bool:
        """True if the last datagram comes from the other end."""
        return bool((self.memory.sender == self.memory.peer).all())

    def answer_sender(self) -> None:
        """Make the sender of the last datagram the other end."""
        self.memory.peer[:] = self.memory.sender


def _host_and_port(address: np.ndarray) -> tuple[str, int]:
    data = address.tobytes()
    return socket.inet_ntoa(data[4:8]), int.from_bytes(data[2:4], "big")
