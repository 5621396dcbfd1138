"""How a protocol says which messages it answers."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from services.mavlink.dialect import id_of

if TYPE_CHECKING:
    from services.mavlink.adapter import Adapter
    from services.mavlink.client import Client

Handler = Callable[["Adapter", "Client", Any], None]

HANDLERS: dict[int, Handler] = {}
"""Who answers a message, by its number."""


def handles(*names: str) -> Callable[[Handler], Handler]:
    """Declare the function that answers these messages."""

    def declare(handler: Handler) -> Handler:
        for number in map(id_of, names):
            if number is not None:
                HANDLERS[number] = handler
        return handler

    return declare
