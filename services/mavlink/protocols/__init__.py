"""Requests of endpoints; each file implements a MAVLink protocol and declares the messages that it handles."""

from functools import cache

from lapwing.dynamics import discovery
from lapwing.services.mavlink.protocols.handler import HANDLERS, Handler

__all__ = ["Handler", "handlers"]


@cache
def handlers() -> dict[int, Handler]:
    """Return all handlers by message number."""
    discovery.modules(__name__)
    return HANDLERS
