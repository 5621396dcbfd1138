"""MSP version 1 over TCP: status and command line of the firmware."""

import contextlib
import functools
import operator
import socket
import struct
from typing import NamedTuple

STATUS = 150  # MSP_STATUS_EX
ARM = 1  # bit of the flight mode flags
BLOCKERS = (
    "no gyro", "failsafe", "no RC signal", "not disarmed", "failsafe switch", "runaway take-off", "crash detected",
    "throttle not low", "tilted", "starting", "no prearm", "CPU load", "calibrating", "command line", "menu", "BST",
    "MSP", "paralysed", "GPS", "rescue switch", "DSHOT telemetry", "reboot required", "DSHOT bitbang",
    "accelerometer not calibrated", "motor protocol", "crash flip", "altitude hold", "position hold", "arm switch",
)  # fmt: skip
HEADER = b"$M>"
LARGEST = 1 << 16  # [bytes] without a message, after which the buffer is discarded


class FirmwareStatus(NamedTuple):
    """Status of the firmware."""

    armed: bool
    blockers: tuple[str, ...]  # reasons why it cannot be armed
    load: float  # fraction of its scheduler's CPU time


def request(command: int, payload: bytes = b"") -> bytes:
    """Return a request."""
    body = bytes((len(payload), command)) + payload
    return b"$M<" + body + bytes((_checksum(body),))


def _checksum(body: bytes) -> int:
    return functools.reduce(operator.xor, body, 0)


def parse_status(payload: bytes) -> FirmwareStatus:
    """Return the status of an MSP_STATUS_EX reply.

    Raises:
        ValueError: the payload is too short.
    """
    try:
        flags, _, load = struct.unpack_from("<IBH", payload, 6)
        extra = payload[15] & 0xF
        bits: int = struct.unpack_from("<I", payload, 17 + extra)[0]
    except (struct.error, IndexError):
        raise ValueError(f"MSP status of {len(payload)} bytes is too short") from None
    blockers = tuple(name for i, name in enumerate(BLOCKERS) if bits >> i & 1)
    return FirmwareStatus(bool(flags & ARM), blockers, load * 1e-2)


class Msp:
    """Non-blocking connection, whose replies are polled."""

    def __init__(self, host: str, port: int):
        """Connect. Raise OSError if nothing listens."""
        self._socket = socket.create_connection((host, port), timeout=0.2)
        self._socket.setblocking(False)
        self._data = b""

    def send(self, data: bytes) -> None:
        """Send data, or discard it if the connection is lost: `poll` then returns nothing."""
        with contextlib.suppress(OSError):
            self._socket.sendall(data)

    def poll(self) -> list[tuple[int, bytes]]:
        """Return the replies (command, payload) that have arrived since the last call, without malformed ones."""
        with contextlib.suppress(OSError):
            while part := self._socket.recv(4096):
                self._data += part
        result = []
        while (i := self._data.find(HEADER)) >= 0 and len(self._data) >= i + 6:
            size = self._data[i + 3]
            if len(self._data) < i + 6 + size:
                break
            body = self._data[i + 3 : i + 5 + size]
            if _checksum(body) == self._data[i + 5 + size]:
                result.append((body[1], body[2:]))
                self._data = self._data[i + 6 + size :]
            else:
                self._data = self._data[i + 3 :]
        if len(self._data) > LARGEST:
            self._data = b""
        return result

    def text(self) -> str:
        """Return the output of the command line that has arrived since the last call."""
        with contextlib.suppress(OSError):
            while part := self._socket.recv(4096):
                self._data += part
        result, self._data = self._data.decode(errors="replace"), b""
        return result

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()
