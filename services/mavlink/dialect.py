"""The MAVLink dialect: the common messages and the few that ArduPilot's clients need besides."""

from functools import cache
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

__all__ = ["id_of", "mavlink", "name_of"]


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
