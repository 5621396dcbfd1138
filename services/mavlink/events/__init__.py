"""What ground stations are told has happened: a file for each sort, which declares the events and looks for them."""

from collections.abc import Mapping
from functools import cache

from lapwing.dynamics import discovery
from lapwing.services.mavlink.events.definition import DEFINITIONS, WATCHES, Definition, EventDetector

__all__ = ["Definition", "EventDetector", "definitions", "watches"]


@cache
def definitions() -> Mapping[str, Definition]:
    """Every event by its name."""
    discovery.modules(__name__)
    return DEFINITIONS


def watches() -> list[EventDetector]:
    """What looks for them, anew for one vehicle."""
    definitions()
    return [kind() for kind in WATCHES]
