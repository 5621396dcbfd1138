"""What the vehicle sends without being asked: one table of messages, gathered from the files of this folder."""

from functools import cache
from typing import Any

from lapwing.dynamics import discovery
from lapwing.services.mavlink.telemetry.message_stream import ON_REQUEST, STREAMS, Stream
from lapwing.services.mavlink.vehicle_cache import VehicleCache

__all__ = ["Stream", "requested", "streams"]


@cache
def streams() -> dict[int, Stream]:
    """Every stream by the number of its message; what the dialect lacks is not there."""
    discovery.modules(__name__)
    return STREAMS


def requested(vehicle: VehicleCache, number: int, parameter: float = 0.0) -> list[Any] | None:
    """The messages that answer a request for one of this number, as they would be now.

    Args:
        vehicle: its newest state.
        number: of the message.
        parameter: the request's second, which some messages depend on.

    Returns:
        None for a message that is not of the telemetry; empty while it has no content.
    """
    if number in streams():
        return streams()[number].messages(vehicle)
    return ON_REQUEST[number](vehicle, parameter) if number in ON_REQUEST else None
