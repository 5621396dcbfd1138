"""Mean absolute prediction errors over windows with confidence intervals, and those that measurement noise causes.

A window starts in a measured state and ends at a measured one, and the trim follows from measurements. So even the true
model has errors. They are those that the same noise, added once more, adds to a prediction.
"""

import warnings
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.stats import t as student

from lapwing.flights.log_import.recording import Recording
from lapwing.flights.rotation_arrays import conjugate, from_vector, product, rotation_vector
from lapwing.studies.validation.windows import POWER, WIDTH, Errors, compare

FIELDS = ("position", "velocity", "attitude", "rate", "specific_force", "power")
RESAMPLES = 2000  # number of bootstrap samples over clusters
CONFIDENCE = 0.95
FEWEST_CLUSTERS = 3  # for an interval
FEWEST_FLIGHTS = 8  # for intervals over flights
BLOCK = 2.0  # [s] of flight that counts as one independent observation if there are fewer flights


class Metric(NamedTuple):
    """A mean or ratio of means over windows, and its confidence interval over clusters of windows."""

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


def clusters(starts: Sequence[np.ndarray], interval: float) -> np.ndarray:
    """Return the index of the cluster of each window of all flights.

    Flights are independent, windows of one flight are not. A few flights say little about others: fewer than
    `FEWEST_FLIGHTS` are split into blocks of `BLOCK`, whose interval is for flights like these.

    Args:
        starts: first samples of the windows of each flight.
        interval: duration of a sample [s].
    """
    length = np.inf if len(starts) >= FEWEST_FLIGHTS else BLOCK / interval
    names = [k * 1_000_000 + s // length for k, s in enumerate(starts)]
    return np.unique(np.concatenate(names), return_inverse=True)[1]


def pool(values: np.ndarray, cluster: np.ndarray) -> list[list[Metric]]:
    """Return the mean over all windows by horizon and field; windows without the quantity do not count.

    Args:
        values: magnitudes of all windows, shape (n, h, fields).
        cluster: index of the cluster of each window, shape (n,).
    """
    return _metrics(_sums(values, cluster), _sums(np.isfinite(values), cluster))


def ratios(values: np.ndarray, baseline: np.ndarray, cluster: np.ndarray) -> list[list[Metric]]:
    """Return the mean over windows divided by that of a baseline, by horizon and field. See `pool`.

    Both are resampled together, so what makes a flight hard for both does not widen the interval.
    """
    known = np.isfinite(values) & np.isfinite(baseline)
    return _metrics(*(_sums(np.where(known, v, np.nan), cluster) for v in (values, baseline)))


def _sums(values: np.ndarray, cluster: np.ndarray) -> np.ndarray:
    total = np.zeros((int(cluster.max()) + 1, *values.shape[1:]))
    np.add.at(total, cluster, np.nan_to_num(values))
    return total


def _metrics(numerator: np.ndarray, denominator: np.ndarray) -> list[list[Metric]]:
    """Return the ratio of the sums over clusters, with an interval by a bootstrap over clusters.

    The logarithm of the ratio is resampled, and its spread scaled by Student's distribution: percentiles of so few
    values as a handful of flights are too narrow.

    Args:
        numerator: sums of each cluster, shape (clusters, h, fields).
        denominator: likewise.
    """
    draws = np.random.default_rng(1).integers(0, len(numerator), (RESAMPLES, len(numerator)))
    weights = np.stack([np.bincount(d, minlength=len(numerator)) for d in draws]).astype(float)
    count = (denominator > 0.0).sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of quantities that no flight has measured
        mean = numerator.sum(axis=0) / denominator.sum(axis=0)
        sampled = np.log(np.tensordot(weights, numerator, 1) / np.tensordot(weights, denominator, 1))
        deviation = np.nanstd(sampled, axis=0) * np.sqrt(count / (count - 1.0))
        factor = np.exp(deviation * student.ppf(0.5 + 0.5 * CONFIDENCE, np.maximum(count - 1, 1)))
    factor[count < FEWEST_CLUSTERS] = np.nan
    return [
        [Metric(*map(float, values)) for values in zip(*row, strict=True)]
        for row in zip(mean, mean / factor, mean * factor, strict=True)
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


ORDER, GAIN = 4, 70.0**0.5  # difference in which smooth motion vanishes, and its gain for white noise
NORMAL = 1.4826  # standard deviation over median of the absolute values


def noisier(flight: Recording, seed: int = 1) -> Recording:
    """Return the flight with noise of its own size added to motion and specific force, independent at each sample."""
    draw = np.random.default_rng(seed)
    vectors = {name: getattr(flight, name) for name in ("position", "velocity", "omega", "specific_force")}
    noise = {name: _deviation(v, flight.valid, ORDER) * draw.standard_normal(v.shape) for name, v in vectors.items()}
    turn = np.zeros((len(flight), 3))
    turn[1:] = rotation_vector(product(conjugate(flight.attitude[:-1]), flight.attitude[1:]))
    tilt = _deviation(turn, flight.valid, ORDER - 1) * draw.standard_normal(turn.shape)
    attitude = product(flight.attitude, from_vector(tilt))
    return replace(flight, attitude=attitude, **{name: v + noise[name] for name, v in vectors.items()})


def _deviation(values: np.ndarray, valid: np.ndarray, order: int) -> np.ndarray:
    """Return the standard deviation of the white noise of each column, shape (k,); 0 for too few valid samples."""
    whole = np.convolve(valid, np.ones(ORDER + 1), "valid") > ORDER + 0.5
    differences = np.diff(values, n=order, axis=0)[ORDER - order :]
    known = differences[whole & np.isfinite(differences).all(axis=1)]
    return NORMAL * np.median(np.abs(known), axis=0) / GAIN if len(known) else np.zeros(values.shape[1])
