"""The MAVLink dialect: all that pymavlink knows, and what it leaves out."""

from functools import cache
from typing import Any

from lapwing.services.mavlink.extra_messages import mavlink

__all__ = ["id_of", "mavlink", "message_class", "name_of"]


@cache
def _ids() -> dict[str, int]:
    return {message.msgname: number for number, message in mavlink.mavlink_map.items()}


def id_of(name: str) -> int | None:
    """Number of a message, None where this dialect lacks it."""
    return _ids().get(name)


def name_of(number: int) -> str | None:
    """Name of a message, None where this dialect lacks it."""
    message: Any = mavlink.mavlink_map.get(number)
    return message.msgname if message else None


def message_class(name: str) -> Any:
    """The class of a message that pymavlink may lack; called with the fields in their order in common.xml."""
    return mavlink.mavlink_map[_ids()[name]]
