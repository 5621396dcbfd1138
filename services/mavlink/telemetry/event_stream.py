"""How far the events have come."""

from typing import Any

from lapwing.services.mavlink.telemetry.message_stream import stream
from lapwing.services.mavlink.vehicle_cache import VehicleCache


@stream("CURRENT_EVENT_SEQUENCE", 1.0 / 3.0)
def current_sequence(v: VehicleCache) -> Any:
    """The number of the last event."""
    return v.events.current() if v.flavour.EVENTS else None
