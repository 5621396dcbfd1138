"""The events of a flight as a topic of its log, so that every viewer shows them."""

from collections.abc import Iterable
from pathlib import Path

from lapwing.cosim.log.log_editing import append
from lapwing.flights.flight_data import FlightData
from lapwing.flights.flight_events import Event
from lapwing.messages import Log, stamp
from lapwing.messages.topics import EVENTS
from lapwing.services.common.event_kinds import KINDS


def event_messages(events: Iterable[Event]) -> list[tuple[int, bytes]]:
    """Return time [ns] and payload of each event, in order."""
    result = []
    for event in events:
        time_ns = max(0, round(event.time * 1e9))
        level = Log.WARN if KINDS[event.kind].serious else Log.INFO
        result.append((time_ns, Log(stamp(time_ns), level, event.kind, event.text).encode()))
    return result


def add_events(log: Path, flight: FlightData) -> None:
    """Write the events of a recorded flight into its finished log, which has no events yet.

    Raises:
        ValueError: the log cannot be written.
    """
    append(log, EVENTS.key(flight.vehicle), Log, event_messages(flight.events))
