"""Mean absolute prediction errors over windows, with confidence intervals over flights."""

from typing import NamedTuple

import numpy as np

from lapwing.studies.flight_import.recording import Recording
from lapwing.studies.rotation_arrays import from_vector, product
from lapwing.studies.validation.windows import POWER, WIDTH, Errors, compare

FIELDS = ("position", "velocity", "attitude", "rate", "specific_force", "power")
RESAMPLES = 2000  # number of bootstrap samples over flights
CONFIDENCE = 95.0  # [%]


class Metric(NamedTuple):
    """A mean over windows and its confidence interval over flights."""

    mean: float
    low: float
    high: float


def magnitudes(errors: Errors) -> np.ndarray:
    """Return the absolute errors of each window: angle of the attitude, mean over axes of vectors.

    The shape is (n, h, 6), in the order of FIELDS; unmeasured specific force and power are NaN.
    """
    means = [np.abs(getattr(errors, name)).mean(axis=-1) for name in ("position", "velocity")]
    angle = np.linalg.norm(errors.attitude, axis=-1)
    rest = [np.abs(getattr(errors, name)).mean(axis=-1) for name in FIELDS[3:]]
    return np.stack([*means, angle, *rest], axis=-1)


def pool_flights(flights: list[np.ndarray], seed: int = 1) -> list[list[Metric]]:
    """Return the mean over all windows by horizon and field, and its confidence interval by a bootstrap over flights.

    Flights are independent, windows of one flight are not. Intervals of fewer than three flights are NaN.

    Args:
        flights: magnitudes of each flight, shape (n, h, fields).
        seed: seed of the bootstrap.
    """
    total = np.array([np.nansum(f, axis=0) for f in flights])
    count = np.array([np.isfinite(f).sum(axis=0) for f in flights])
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = total.sum(axis=0) / count.sum(axis=0)
        low, high = np.full_like(mean, np.nan), np.full_like(mean, np.nan)
        if len(flights) >= 3:
            draws = np.random.default_rng(seed).integers(0, len(flights), (RESAMPLES, len(flights)))
            weights = np.stack([np.bincount(d, minlength=len(flights)) for d in draws]).astype(float)
            sampled = np.tensordot(weights, total, 1) / np.tensordot(weights, count, 1)
            tail = (100.0 - CONFIDENCE) / 2.0
            known = np.isfinite(mean)  # a quantity that no flight has measured has no interval
            low[known], high[known] = np.nanpercentile(sampled[:, known], [tail, 100.0 - tail], axis=0)
    return [
        [Metric(float(m), float(a), float(b)) for m, a, b in zip(*row, strict=True)]
        for row in zip(mean, low, high, strict=True)
    ]


def constant_velocity(flight: Recording, starts: np.ndarray, horizons: tuple[int, ...]) -> Errors:
    """Return the errors of a prediction with constant velocity, body rate and power."""
    time = np.array(horizons) * flight.interval
    shape = (len(starts), len(horizons))
    predicted = np.zeros((*shape, WIDTH))
    velocity, omega = flight.velocity[starts][:, None], flight.omega[starts][:, None]
    predicted[..., :3] = flight.position[starts][:, None] + velocity * time[:, None]
    predicted[..., 3:7] = product(flight.attitude[starts][:, None], from_vector(omega * time[:, None]))
    predicted[..., 7:10] = velocity
    predicted[..., 10:13] = omega
    predicted[..., POWER] = flight.power[starts][:, None] if len(flight.power) else np.nan
    return compare(flight, starts, horizons, predicted)
