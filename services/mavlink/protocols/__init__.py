"""What endpoints may ask for: a file for each protocol of MAVLink, each declaring which messages it handles."""

from functools import cache

from lapwing.dynamics import discovery
from lapwing.services.mavlink.protocols.handler import HANDLERS, Handler

__all__ = ["Handler", "handlers"]


@cache
def handlers() -> dict[int, Handler]:
    """Every handler by the number of its message."""
    discovery.modules(__name__)
    return HANDLERS
