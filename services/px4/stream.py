"""TCP connection for compiled code and Python, which share the memory of its bytes."""

import ctypes
import socket
from typing import Any, NamedTuple

import numpy as np

from lapwing.kernels import always_inline
from lapwing.kernels.native_calls import address_of, call_int, call_long, poll_entry

PIECE = 65536  # [bytes] most that one call receives
SENT = 2048  # [bytes] most for the messages of a step
WAIT = 0.2  # [s] of one wait
CLOSED, NOTHING = 0, -1  # results of `receive`
_NO_SIGNAL: int = getattr(socket, "MSG_NOSIGNAL", 0)  # Python ignores SIGPIPE anyway


class Stream(NamedTuple):
    """Memory and functions of a connection."""

    descriptor: Any  # (1,) int64
    entry: Any  # (1,) int64: `struct pollfd`
    sent: Any  # bytes of the messages of a step
    sent_size: Any  # (1,)
    received: Any  # bytes
    sequence: Any  # (1,) int64 number of the next frame, 0 to 255
    rest: Any  # (1,) bytes of an incomplete frame, which Python stores
    addresses: tuple[int, int, int]  # of sent, received, entry
    send: int  # addresses of functions
    recv: int
    poll: int


def stream() -> Stream:
    """Return the memory of a closed connection."""
    libc = ctypes.CDLL(None)
    sent, received, entry = np.zeros(SENT, np.uint8), np.zeros(PIECE, np.uint8), np.zeros(1, np.int64)
    scalars = [np.zeros(1, np.int64) for _ in range(3)]
    return Stream(
        np.full(1, -1), entry, sent, scalars[0], received, scalars[1], scalars[2],
        (sent.ctypes.data, received.ctypes.data, entry.ctypes.data),
        address_of(libc.send), address_of(libc.recv), address_of(libc.poll),
    )  # fmt: skip


def connect(c: Stream, descriptor: int) -> None:
    """Use another socket; -1: none."""
    c.descriptor[0], c.rest[0] = descriptor, 0
    c.entry[:] = poll_entry(descriptor)


@always_inline
def send(c: Stream) -> bool:
    """Send the messages of the step. Return True if all were sent."""
    size = c.sent_size[0]
    return call_long(c.send, (c.descriptor[0], c.addresses[0], size, _NO_SIGNAL)) == size


@always_inline
def receive(c: Stream) -> int:
    """Wait for bytes at most 0.2 s. Return their number, CLOSED, or NOTHING."""
    if call_int(c.poll, (c.addresses[2], 1, int(1000.0 * WAIT))) != 1:
        return NOTHING
    return call_long(c.recv, (c.descriptor[0], c.addresses[1], PIECE, 0))
