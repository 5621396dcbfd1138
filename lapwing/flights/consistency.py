"""Consistency of an estimate: normalised errors and innovations squared (theory, eqs. (3.46) and (3.47)).

Source: Bar-Shalom, Li and Kirubarajan, "Estimation with Applications to Tracking and Navigation", Wiley 2001, 5.4.
"""

import math

import numpy as np

from lapwing.flights.flight_data import FlightData
from lapwing.flights.rotation_arrays import conjugate, from_xyzw, product, rotation_vector

STATES = 24  # number of error states of the estimator
JOINT = 9  # number of states with a true value: attitude, velocity, position
CONFIDENCE = 0.95  # level of all bounds
SOURCES = {"gps": (1, 3), "gps_velocity": (2, 3), "barometer": (3, 1), "sonar": (4, 1), "magnetometer": (5, 1)}
"""Index in `nis` and dimension of each source."""
TOPIC = "estimate/covariance"


def bounds(dimension: int, runs: int) -> tuple[float, float]:
    """Return the two-sided 95 % bounds of the mean of normalised squared errors over independent runs."""
    low, high = [chi_square_quantile(0.5 + 0.5 * sign * CONFIDENCE, dimension * runs) / runs for sign in (-1.0, 1.0)]
    return low, high


def chi_square_quantile(probability: float, degrees: int) -> float:
    """Return the quantile at `probability` of the chi-square distribution with `degrees` of freedom."""
    from scipy.special import gammaincinv  # imported here to keep the start of `lapwing run` short

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
    """Return `nees`, the share `within_95.nees` and `nis.SOURCE` of a flight while armed, or {} without a covariance.

    `nees` is the mean over time, 9 for a consistent estimate; `nis.SOURCE` is the mean per dimension, ideally 1.
    """
    if not flight.has(TOPIC) or not len(flight.topic(TOPIC)) or not flight.armed.any():
        return {}
    reported, truth, estimate = flight.topic(TOPIC), flight.truth, flight.estimate
    indices = [_matching_indices(view.times, reported.times) for view in (truth, estimate)]
    n = len(flight.armed)
    valid = (indices[0] >= 0) & (indices[1] >= 0) & (indices[0] < n) & (np.asarray(reported.covariance)[:, 0] > 0.0)
    valid[valid] &= flight.armed[indices[0][valid]]
    if not valid.any():
        return {}
    t, e = indices[0][valid], indices[1][valid]
    after, before = from_xyzw(truth.orientation[t]), from_xyzw(estimate.orientation[e])
    attitude_error = rotation_vector(product(after, conjugate(before)))
    translation_errors = [truth.velocity[t] - estimate.velocity[e], truth.position[t] - estimate.position[e]]
    value = nees(np.hstack([attitude_error, *translation_errors]), joint_covariance(reported.covariance[valid]))
    result = {
        "nees": float(value.mean()),
        "within_95.nees": float(np.mean(value < chi_square_quantile(CONFIDENCE, JOINT))),
    }
    result["nis_samples"] = float(len(value))
    for source, (column, dimension) in SOURCES.items():
        nis = reported.nis[valid, column]
        nis = nis[nis > 0.0]  # 0: the source has not been fused
        result[f"nis.{source}"] = float(nis.mean()) / dimension if len(nis) else math.nan
    return result


def _matching_indices(times: np.ndarray, desired: np.ndarray) -> np.ndarray:
    """Return the index of each `desired` time [s], shape (n,), in the ascending `times`, or -1 if it is missing."""
    if not len(times):
        return np.full(len(desired), -1)
    nearest = np.minimum(np.searchsorted(times, desired - 1e-6), len(times) - 1)
    return np.where(np.abs(times[nearest] - desired) < 1e-6, nearest, -1)
