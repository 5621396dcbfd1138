"""Endpoints of participants that a test starts, and their presence."""

import socket
import time
from collections.abc import Iterable

from lapwing.cosim.transport.bus import ZenohBus


def loopback_endpoints(names: Iterable[str]) -> dict[str, str]:
    """Return a free TCP endpoint on the loopback interface for each name."""
    sockets = {name: socket.create_server(("127.0.0.1", 0)) for name in names}
    endpoints = {name: f"tcp/127.0.0.1:{s.getsockname()[1]}" for name, s in sockets.items()}
    for s in sockets.values():
        s.close()
    return endpoints


def absent(bus: ZenohBus, keys: Iterable[str], timeout: float) -> set[str]:
    """Wait until a participant is present for each key. Return the keys that are missing after `timeout` [s]."""
    missing = set(keys)
    for key in list(missing):
        bus.watch_liveliness(key, lambda name, alive: missing.discard(name) if alive else None)
    deadline = time.monotonic() + timeout
    while missing and time.monotonic() < deadline:
        time.sleep(0.01)
    return missing
