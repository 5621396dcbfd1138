"""Flights of shipped scenes with overrides."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from lapwing.flights.flight_data import FlightData
from lapwing.messages.topics import TRUTH
from lapwing.services.scene_resolver import load
from lapwing.studies import simulate


def fly(scene: str, overrides: Iterable[str] = (), topics: Any = (TRUTH,)) -> FlightData:
    """Fly a scene with overrides "KEY=VALUE" to its end or to a non-finite state.

    Raises:
        SceneError: an override is invalid.
    """
    result: FlightData = simulate.fly(load(scene, list(overrides)), topics)
    return result


def finite(flight: FlightData) -> bool:
    """Return True if all recorded motion is finite."""
    truth = flight.truth
    return all(
        np.isfinite(a).all() for a in (truth.position, truth.orientation, truth.velocity, truth.angular_velocity)
    )
