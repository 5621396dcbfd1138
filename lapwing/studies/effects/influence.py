"""Change of a flight when an effect is left out or added."""

from typing import NamedTuple

import numpy as np

from lapwing.studies.flight_data import FlightData


class Influence(NamedTuple):
    """The difference that one effect makes; infinite where the flight without it comes to no end."""

    trajectory: float  # largest distance between the two at one time [m]
    final: float  # distance between the ends [m]
    energy: float  # relative change of the electrical energy
    failure: str = ""


def influence(flown: FlightData, other: FlightData) -> Influence:
    """Return the difference of `other` from `flown`; a shorter flight is extended by its last state."""
    if other.failure:
        return Influence(np.inf, np.inf, np.inf, other.failure)
    count = max(len(flown.truth), len(other.truth))
    a, b = (_held(flight.truth.position, count) for flight in (flown, other))
    apart = np.linalg.norm(a - b, axis=1)
    change = (other.energy - flown.energy) / flown.energy if flown.energy else 0.0
    return Influence(float(apart.max()), float(apart[-1]), float(change))


def _held(position: np.ndarray, count: int) -> np.ndarray:
    return np.concatenate([position, np.repeat(position[-1:], count - len(position), axis=0)])
