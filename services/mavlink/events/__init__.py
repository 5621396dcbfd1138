"""Events for ground stations; each file declares a group of events and their detectors."""

from collections.abc import Mapping
from functools import cache

from lapwing.dynamics import discovery
from lapwing.services.mavlink.events.definition import DEFINITIONS, DETECTORS, Definition, EventDetector

__all__ = ["Definition", "EventDetector", "definitions", "new_detectors"]


@cache
def definitions() -> Mapping[str, Definition]:
    """Return all events by name."""
    discovery.modules(__name__)
    return DEFINITIONS


def new_detectors() -> list[EventDetector]:
    """Return new event detectors for a vehicle."""
    definitions()
    return [kind() for kind in DETECTORS]
