"""Telemetry messages: one table, collected from the files of this folder."""

from functools import cache
from typing import Any

from lapwing.dynamics import discovery
from lapwing.services.mavlink.telemetry.message_stream import ON_REQUEST, STREAMS, Stream
from lapwing.services.mavlink.vehicle_cache import VehicleCache

__all__ = ["Stream", "answer_request", "streams"]


@cache
def streams() -> dict[int, Stream]:
    """Return all streams by message number, without those that the dialect lacks."""
    discovery.modules(__name__)
    return STREAMS


def answer_request(vehicle: VehicleCache, number: int, parameter: float = 0.0) -> list[Any] | None:
    """Return the current messages that answer a request.

    Args:
        vehicle: newest state of the vehicle.
        number: message number.
        parameter: second parameter of the request, which some messages depend on.

    Returns:
        None for a message that is not telemetry; empty while it has no content.
    """
    if number in streams():
        return streams()[number].messages(vehicle)
    return ON_REQUEST[number](vehicle, parameter) if number in ON_REQUEST else None
