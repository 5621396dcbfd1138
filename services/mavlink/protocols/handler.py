"""Declaration of the messages that a protocol handles."""

from collections.abc import Callable
from typing import Any

from lapwing.services.common.mavlink.dialect import id_of
from lapwing.services.mavlink.session import Session

Handler = Callable[[Session, Any], None]

HANDLERS: dict[int, Handler] = {}
"""The handlers that have been declared, by the number of their message."""


def handles(*names: str) -> Callable[[Handler], Handler]:
    """Declare the function that handles these messages."""

    def declare(handler: Handler) -> Handler:
        for number in map(id_of, names):
            if number is not None:
                HANDLERS[number] = handler
        return handler

    return declare
