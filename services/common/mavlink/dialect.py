"""MAVLink dialect of pymavlink, with additional messages."""

from functools import cache
from typing import Any

from lapwing.services.common.mavlink.extra_messages import mavlink

__all__ = ["id_of", "mavlink", "message_class"]


@cache
def _ids() -> dict[str, int]:
    return {message.msgname: number for number, message in mavlink.mavlink_map.items()}


def id_of(name: str) -> int | None:
    """Return the number of a message. Return None if the dialect lacks it."""
    return _ids().get(name)


def message_class(name: str) -> Any:
    """Return the class of a message that pymavlink may lack; arguments: the fields in the order of common.xml."""
    return mavlink.mavlink_map[_ids()[name]]
