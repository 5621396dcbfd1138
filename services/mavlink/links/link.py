"""Base class of links."""

import re
import socket
import time
from selectors import BaseSelector
from typing import ClassVar

from lapwing.services.mavlink.adapter import Adapter

ROUND = 64  # pieces of bytes read from one socket before others get their turn
PIECE = 2048  # [bytes] a piece is no longer
MAX_RATE = 2000.0  # [1/s] pieces that a link takes; what comes faster is dropped unread


class Budget:
    """Rate limit of the pieces that a link reads, with a burst of one second."""

    def __init__(self, rate: float = MAX_RATE):
        self._rate, self._left, self._then = rate, rate, time.monotonic()

    def take(self) -> bool:
        """Return True if another piece may be read."""
        now = time.monotonic()
        self._left = min(self._rate, self._left + (now - self._then) * self._rate)
        self._then = now
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True


class Link:
    """A socket or a device that endpoints are behind. Subclasses read it when the selector says so."""

    SCHEME: ClassVar[str] = ""
    FORM: ClassVar[str] = ""

    def __init__(self, rest: str, adapter: Adapter, selector: BaseSelector):
        """Open it. `rest` is the URL behind its first word; raises OSError."""
        self.adapter, self.selector, self.budget = adapter, selector, Budget()

    @staticmethod
    def fits(rest: str) -> bool:
        """Return True if the rest of a URL has this link's form: host and port."""
        match = re.fullmatch(r"[\w.-]+:(\d+)", rest, re.ASCII)
        return match is not None and int(match[1]) < 65536

    @classmethod
    def for_vehicle_index(cls, rest: str, i: int) -> str:
        """Return the rest of the URL for vehicle i (from 0); the same for all that send to one station."""
        return rest

    def affords(self) -> bool:
        """Return True if another piece may be read; count it otherwise."""
        if self.budget.take():
            return True
        self.adapter.counts["faster than a link takes"] += 1
        return False

    def close(self) -> None:
        """Close it."""
        raise NotImplementedError


def next_port(rest: str, i: int) -> str:
    """Return host and port plus i. Raise ValueError if the port is too large."""
    host, _, port = rest.rpartition(":")
    if int(port) + i > 65535:
        raise ValueError(f"port {port}: the link of vehicle {i} would be at {int(port) + i}")
    return f"{host}:{int(port) + i}"


def socket_address(rest: str) -> tuple[str, int]:
    """Return the numeric host and the port. Raise OSError for an unknown host."""
    host, _, port = rest.rpartition(":")
    return socket.gethostbyname(host), int(port)
