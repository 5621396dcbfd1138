"""Sequence number of the events."""

from typing import Any

from lapwing.services.mavlink.telemetry.message_stream import stream
from lapwing.services.mavlink.vehicle_cache import VehicleCache


@stream("CURRENT_EVENT_SEQUENCE", 1.0 / 3.0)
def current_sequence(v: VehicleCache) -> Any:
    """Return the number of the last event."""
    return v.events.current() if v.firmware.EVENTS else None
