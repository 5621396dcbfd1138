"""Change of a flight when an effect is left out or added."""

from typing import NamedTuple

import numpy as np

from lapwing.studies.flight_data import FlightData


class Influence(NamedTuple):
    """Change of a flight by one effect; infinite if the changed flight fails."""

    trajectory: float  # [m] largest distance at equal times
    final: float  # [m] distance of the final positions
    energy: float  # relative change of the electrical energy
    failure: str = ""  # error of the changed flight


def influence(reference: FlightData, other: FlightData) -> Influence:
    """Return the difference of `other` from `reference`; a shorter flight is extended by its last state."""
    if other.failure:
        return Influence(np.inf, np.inf, np.inf, other.failure)
    count = max(len(reference.truth), len(other.truth))
    a, b = (_extend(flight.truth.position, count) for flight in (reference, other))
    distance = np.linalg.norm(a - b, axis=1)
    change = (other.energy - reference.energy) / reference.energy if reference.energy else 0.0
    return Influence(float(distance.max()), float(distance[-1]), float(change))


def _extend(position: np.ndarray, count: int) -> np.ndarray:
    return np.concatenate([position, np.repeat(position[-1:], count - len(position), axis=0)])
