"""TCP connection for compiled code and Python, which share the memory of its bytes."""

import ctypes
import socket
from typing import Any, NamedTuple

import numpy as np

from lapwing.kernels import always_inline
from lapwing.kernels.native_calls import address_of, call_long
from lapwing.services.common.firmware.datagrams import timeval

PIECE = 65536  # [bytes] most that one call receives
SENT = 2048  # [bytes] most for the messages of a step
WAIT = 0.2  # [s] of one wait
CLOSED, NOTHING = 0, -1  # results of `receive`
SEND_FLAGS: int = getattr(socket, "MSG_NOSIGNAL", 0) | socket.MSG_DONTWAIT  # Python ignores SIGPIPE anyway


class Stream(NamedTuple):
    """Memory and functions of a connection."""

    descriptor: Any  # (1,) int64
    sent: Any  # bytes of the messages of a step
    sent_size: Any  # (1,)
    received: Any  # bytes
    sequence: Any  # (1,) int64 number of the next frame, 0 to 255
    rest: Any  # (1,) bytes of an incomplete frame, which Python stores
    addresses: tuple[int, int]  # addresses of sent, received
    send: int  # addresses of functions
    recv: int


def stream() -> Stream:
    """Return the memory of a closed connection."""
    libc = ctypes.CDLL(None)
    sent, received = np.zeros(SENT, np.uint8), np.zeros(PIECE, np.uint8)
    scalars = [np.zeros(1, np.int64) for _ in range(3)]
    return Stream(
        np.full(1, -1), sent, scalars[0], received, scalars[1], scalars[2],
        (sent.ctypes.data, received.ctypes.data), address_of(libc.send), address_of(libc.recv),
    )  # fmt: skip


def connect(c: Stream, peer: socket.socket | None) -> None:
    """Use another socket; None: none. A receive call then ends after 0.2 s."""
    c.descriptor[0], c.rest[0] = peer.fileno() if peer else -1, 0
    if peer:
        peer.setblocking(True)
        peer.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, timeval(WAIT))


@always_inline
def send(c: Stream) -> bool:
    """Send the messages of the step. Return True if all were sent."""
    size = c.sent_size[0]
    return call_long(c.send, (c.descriptor[0], c.addresses[0], size, SEND_FLAGS)) == size


@always_inline
def receive(c: Stream) -> int:
    """Wait for bytes at most 0.2 s. Return their number, CLOSED, or NOTHING."""
    return call_long(c.recv, (c.descriptor[0], c.addresses[1], PIECE, 0))
