"""Base class of links."""

import re
import socket
import time
from collections import Counter
from collections.abc import Callable
from selectors import BaseSelector
from typing import Any, ClassVar, Protocol

Endpoint = Any  # created by a receiver


class Receiver(Protocol):
    """Receiver of the bytes of endpoints. `Adapter` documents the methods."""

    counts: Counter[str]

    def connect(self, local: bool, datagrams: bool, put: Callable[[bytes], None], strict: bool = False) -> Endpoint:
        """Return a new endpoint."""

    def disconnect(self, endpoint: Endpoint) -> None:
        """Remove an endpoint."""

    def receive(self, endpoint: Endpoint, data: bytes) -> int:
        """Handle bytes from an endpoint. Return the number of valid messages."""


ROUND = 64  # pieces of bytes read from one socket before the next socket is read
PIECE = 2048  # [bytes] longest piece
MAX_ENDPOINTS = 8  # limit of a link that listens
MAX_RATE = 2000.0  # [1/s] pieces that a link reads; more are dropped


class Budget:
    """Rate limit of the pieces that a link reads, with a burst of one second."""

    def __init__(self, rate: float = MAX_RATE):
        self._rate, self._left, self._updated = rate, rate, time.monotonic()

    def take(self) -> bool:
        """Return True if another piece may be read."""
        now = time.monotonic()
        self._left = min(self._rate, self._left + (now - self._updated) * self._rate)
        self._updated = now
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True


class Link:
    """Socket or device with endpoints. Subclasses read it when the selector reports data."""

    SCHEME: ClassVar[str] = ""
    FORM: ClassVar[str] = ""
    LISTENS: ClassVar[bool] = False  # True if several vehicles need a port each

    def __init__(self, rest: str, adapter: Receiver, selector: BaseSelector):
        """Open the link. `rest` is the URL without its scheme. Raise OSError if it cannot be opened."""
        self.adapter, self.selector, self.budget = adapter, selector, Budget()

    @staticmethod
    def fits(rest: str) -> bool:
        """Return True if the rest of a URL has this link's form: host and port."""
        match = re.fullmatch(r"[\w.-]+:(\d+)", rest, re.ASCII)
        return match is not None and int(match[1]) < 65536

    @classmethod
    def for_vehicle_index(cls, rest: str, i: int) -> str:
        """Return the rest of the URL for vehicle i (from 0): the next port if the link listens, otherwise unchanged."""
        return next_port(rest, i) if cls.LISTENS else rest

    def may_read(self) -> bool:
        """Return True if another piece may be read; count it otherwise."""
        if self.budget.take():
            return True
        self.adapter.counts["above the rate limit"] += 1
        return False

    def close(self) -> None:
        """Close the link."""
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
