"""Endpoints for participants that a test starts."""

import socket
from collections.abc import Iterable


def loopback_endpoints(names: Iterable[str]) -> dict[str, str]:
    """Return a free TCP endpoint on the loopback interface for each name."""
    sockets = {name: socket.create_server(("127.0.0.1", 0)) for name in names}
    endpoints = {name: f"tcp/127.0.0.1:{s.getsockname()[1]}" for name, s in sockets.items()}
    for s in sockets.values():
        s.close()
    return endpoints
