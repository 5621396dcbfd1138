"""Interface of the adapter for links, which do not import it, so that URLs are checked without pymavlink."""

from collections import Counter
from collections.abc import Callable
from typing import Any, Protocol

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
