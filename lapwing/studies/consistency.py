"""Consistency of an estimate: normalised errors and innovations squared (theory.md, eqs. (3.46) and (3.47)).

Source: Bar-Shalom, Li and Kirubarajan, "Estimation with Applications to Tracking and Navigation", Wiley 2001, 5.4.
"""

import math

import numpy as np

from lapwing.studies.flight_data import FlightData

STATES = 24  # error states of the estimator
JOINT = 9  # attitude, velocity and position, of which the truth is known
SURE = 0.95  # of every bound
SOURCES = {"gps": (1, 3), "gps_velocity": (2, 3), "barometer": (3, 1), "sonar": (4, 1), "magnetometer": (5, 1)}
"""Place in `nis` and dimension of each source."""
TOPIC = "estimate/covariance"


def bounds(dimension: int, runs: int) -> tuple[float, float]:
    """Return the two-sided 95 % bounds of the mean of normalised squared errors over independent runs."""
    low, high = [chi_square_quantile(0.5 + 0.5 * sign * SURE, dimension * runs) / runs for sign in (-1.0, 1.0)]
    return low, high


def chi_square_quantile(probability: float, degrees: int) -> float:
    """Return the quantile of the chi-square distribution with these degrees of freedom."""
    from scipy.special import gammaincinv  # here: `lapwing run` imports this module before it flies

    return 2.0 * float(gammaincinv(0.5 * degrees, probability))


def joint_covariance(triangle: np.ndarray) -> np.ndarray:
    """Return the covariance (n, 9, 9) of attitude, velocity and position from the upper triangle (n, 300)."""
    result = np.empty((len(triangle), JOINT, JOINT))
    for i in range(JOINT):
        first = i * STATES - i * (i - 1) // 2
        for j in range(i, JOINT):
            result[:, i, j] = result[:, j, i] = triangle[:, first + j - i]
    return result


def nees(error: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Return e^T P^-1 e of errors (n, k) with covariances (n, k, k)."""
    scale = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))  # radians and metres differ by orders of magnitude
    unit = error / scale
    correlation = covariance / (scale[:, :, None] * scale[:, None, :])
    return np.einsum("ni,ni->n", unit, np.linalg.solve(correlation, unit[..., None])[..., 0])


def consistency(flight: FlightData) -> dict[str, float]:
    """Return `nees`, the share `within_95.nees` and `nis.SOURCE` of a flight while armed; {} without a covariance.

    `nees` is the mean over time, 9 if the estimate is consistent; `nis.SOURCE` the mean per dimension, 1 if so.
    """
    if not flight.has(TOPIC) or not len(flight.topic(TOPIC)) or not flight.armed.any():
        return {}
    reported, truth, estimate = flight.topic(TOPIC), flight.truth, flight.estimate
    places = [_places(view.times, reported.times) for view in (truth, estimate)]
    n = len(flight.armed)
    there = (places[0] >= 0) & (places[1] >= 0) & (places[0] < n) & (np.asarray(reported.covariance)[:, 0] > 0.0)
    there[there] &= flight.armed[places[0][there]]
    if not there.any():
        return {}
    t, e = places[0][there], places[1][there]
    turned = _rotation_vector(truth.orientation[t], estimate.orientation[e])
    moved = [truth.velocity[t] - estimate.velocity[e], truth.position[t] - estimate.position[e]]
    value = nees(np.hstack([turned, *moved]), joint_covariance(reported.covariance[there]))
    result = {"nees": float(value.mean()), "within_95.nees": float(np.mean(value < chi_square_quantile(SURE, JOINT)))}
    result["nis_samples"] = float(len(value))
    for source, (place, dimension) in SOURCES.items():
        innovations = reported.nis[there, place]
        known = innovations[innovations > 0.0]
        result[f"nis.{source}"] = float(known.mean()) / dimension if len(known) else math.nan
    return result


def _places(times: np.ndarray, desired: np.ndarray) -> np.ndarray:
    """Return the index of each wanted time [s] among ascending times, -1 where it is missing."""
    if not len(times):
        return np.full(len(desired), -1)
    nearest = np.minimum(np.searchsorted(times, desired - 1e-6), len(times) - 1)
    return np.where(np.abs(times[nearest] - desired) < 1e-6, nearest, -1)


def _rotation_vector(after: np.ndarray, before: np.ndarray) -> np.ndarray:
    """Return the world rotation vectors (n, 3) from attitudes `before` to `after`, both (n, 4) x, y, z, w."""
    a, b = after, before * np.array([-1.0, -1.0, -1.0, 1.0])
    vector = a[:, 3:] * b[:, :3] + b[:, 3:] * a[:, :3] + np.cross(a[:, :3], b[:, :3])
    scalar = a[:, 3] * b[:, 3] - np.einsum("ni,ni->n", a[:, :3], b[:, :3])
    vector, scalar = vector * np.sign(scalar + (scalar == 0.0))[:, None], np.abs(scalar)
    size = np.linalg.norm(vector, axis=1)
    return vector * np.where(size > 1e-12, 2.0 * np.arctan2(size, scalar) / np.maximum(size, 1e-300), 2.0)[:, None]
