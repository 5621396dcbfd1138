"""What one flight of a campaign comes to."""

from typing import NamedTuple

import numpy as np

from studies import tracking
from studies.flight import Flight
from studies.verdict import Verdict

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
    verdict: Verdict

    @property
    def failed(self) -> bool:
        """Whether it did not land."""
        return self.verdict.kind != "landed"


def figures(seed: int, flight: Flight) -> Figures:
    """The figures of a flight of which truth, setpoint, actuators, estimate and status are there at every tick."""
    truth, estimate, armed = flight.truth, flight.estimate, flight.armed
    n = len(armed)
    true = np.column_stack(list(flight.errors.values()))
    estimated = tracking.errors(flight.reference, estimate.position[:n], estimate.attitude[:n], armed)
    off = np.abs(estimate.position[:n] - truth.position[:n])[armed]
    inside = (off <= SURE * estimate.position_std[:n][armed]).mean(axis=0) if armed.any() else np.full(3, np.nan)
    return Figures(
        seed,
        flight.rmse,
        tracking.rmse(estimated),
        float(np.linalg.norm(true[:, :3], axis=1).max(initial=0.0)),
        (float(inside[0]), float(inside[1]), float(inside[2])),
        flight.verdict.touchdown,
        flight.energy,
        len(truth) * flight.setup.interval,
        flight.verdict,
    )
