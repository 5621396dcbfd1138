"""Requests of endpoints; each file implements a MAVLink protocol and declares the messages that it handles."""

from collections.abc import Callable
from functools import cache
from typing import Any

from lapwing.dynamics import discovery
from lapwing.services.common.mavlink.dialect import id_of
from lapwing.services.mavlink.session import Session

Handler = Callable[[Session, Any], None]
HANDLERS: dict[int, Handler] = {}
"""Declared handlers by message number."""


def handles(*names: str) -> Callable[[Handler], Handler]:
    """Declare the function that handles these messages."""

    def declare(handler: Handler) -> Handler:
        HANDLERS.update((number, handler) for number in map(id_of, names) if number is not None)
        return handler

    return declare


@cache
def handlers() -> dict[int, Handler]:
    """Return all handlers by message number."""
    discovery.modules(__name__)
    return HANDLERS
