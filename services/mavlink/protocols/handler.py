"""Declaration of the messages that a protocol handles."""

from collections.abc import Callable
from typing import Any

from lapwing.services.common.mavlink.dialect import id_of
from lapwing.services.mavlink.session import Session

Handler = Callable[[Session, Any], None]

HANDLERS: dict[int, Handler] = {}
"""Declared handlers by message number."""


def handles(*names: str) -> Callable[[Handler], Handler]:
    """Declare the function that handles these messages."""

    def declare(handler: Handler) -> Handler:
        for number in map(id_of, names):
            if number is not None:
                HANDLERS[number] = handler
        return handler

    return declare
