"""What one flight of a campaign comes to."""

from typing import NamedTuple

import numpy as np

from studies import tracking
from studies.flight import Flight

HARD = 2.0  # [m/s] downwards at the first touch: a crash
UPSIDE = 0.0  # cosine of the tilt below which the vehicle has turned over: a crash
SURE = 3.0  # standard deviations of its own that the estimate is given


class Figures(NamedTuple):
    """Figures of merit of a flight."""

    seed: int
    rmse: dict[str, float]  # [m], [rad] of the reference against the truth
    rmse_estimate: dict[str, float]  # of the reference against the estimate
    worst: float  # [m] largest distance from the path
    inside: tuple[float, float, float]  # share of the flight with the truth within 3 sigma of the estimate: x, y, z
    touchdown: float  # [m/s] speed downwards at the hardest touch
    energy: float  # [J] electrical
    duration: float  # [s]
    crash: str  # "", or how


def figures(seed: int, flight: Flight) -> Figures:
    """The figures of a flight of which truth, setpoint, actuators, estimate and status are there at every tick."""
    truth, estimate, armed = flight.truth, flight.estimate, flight.armed
    n = len(armed)
    true = np.column_stack(list(flight.errors.values()))
    estimated = tracking.errors(flight.reference, estimate.position[:n], estimate.attitude[:n], armed)
    off = np.abs(estimate.position[:n] - truth.position[:n])[armed]
    inside = (off <= SURE * estimate.position_std[:n][armed]).mean(axis=0) if armed.any() else np.full(3, np.nan)
    touchdown = _touchdown(flight)
    return Figures(
        seed,
        flight.rmse,
        tracking.rmse(estimated),
        float(np.linalg.norm(true[:, :3], axis=1).max(initial=0.0)),
        (float(inside[0]), float(inside[1]), float(inside[2])),
        touchdown,
        flight.energy,
        len(truth) * flight.setup.interval,
        _crash(flight, touchdown),
    )


def _touchdown(flight: Flight) -> float:
    """The greatest speed downwards [m/s] one tick before a touch; 0 without a touch."""
    contact = flight.truth.ground_contact
    touched = np.flatnonzero(contact[1:] & ~contact[:-1])
    return float(max(-flight.truth.velocity[touched, 2].min(initial=0.0), 0.0))


def _crash(flight: Flight, touchdown: float) -> str:
    x, y = flight.truth.orientation[:, 0], flight.truth.orientation[:, 1]
    if flight.failure:
        return "numbers are not finite"
    if (1.0 - 2.0 * (x * x + y * y) < UPSIDE).any():
        return "turned over"
    if touchdown > HARD:
        return f"hit the ground at {touchdown:.1f} m/s"
    return "" if flight.finished else "the mission did not end"
