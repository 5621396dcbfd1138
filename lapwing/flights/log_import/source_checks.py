"""Checks of a log's sources, the same for all formats: gaps, jumps, impossible readings, and frames of velocities."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.ndimage import median_filter

from lapwing.dynamics.constants import STANDARD_GRAVITY
from lapwing.flights.log_import.recording import GYRO_LIMIT, LONGEST_GAP, Series, widen
from lapwing.flights.rotation_arrays import conjugate, continuous, product, rotation_vector, unit

GAP_PERIODS = 3.5  # largest time between two samples for interpolation, in periods of a signal slower than 100 Hz
NEIGHBOURS = 2  # samples on either side of a fault that interpolation or a filter may have changed
HELD = 0.02  # [s] by which a value may be older than its time stamp
NOISY = 10.0  # multiple of the median difference between two sources above which it is no noise
POSITION_STEP, FASTEST_CHANGE = 0.1, 20.0  # [m], [m/s^2]: smallest jump, and change of the acceleration
ATTITUDE_STEP, FASTEST_TURN = 0.15, 25.0  # [rad], [rad/s^2]
VELOCITY_STEP, FASTEST_ACCELERATION = 0.5, 40.0  # [m/s], [m/s^2]
SPIKE, SPIKE_PERIOD = 8.0, 0.02  # [rad/s] from a gyroscope's running median, of one with at most this period [s]
NORM_ERROR = 0.1  # largest deviation of a quaternion's norm from 1
ACCELEROMETER_LIMIT = 16.0 * STANDARD_GRAVITY  # [m/s^2] range of common accelerometers
SLOW, SHARE = 0.15, 0.25  # [m/s] and share of the speed by which velocity and derivative of the position may differ


def gap_limit(time: np.ndarray) -> float:
    """Return the largest time between two samples [s] for interpolation, given the times of all."""
    return max(LONGEST_GAP, GAP_PERIODS * float(np.median(np.diff(time))))


def near(series: Series, grid: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return True for times of `grid` [s] in a gap of a series, and for those next to samples not to be believed.

    Both have shape (len(grid),). A reset separates two samples: neither is believed.
    """
    doubtful = ~series.believed
    if doubtful.any():
        doubtful = widen(doubtful, NEIGHBOURS)
    for mask in series.resets.values():
        doubtful |= mask | np.r_[mask[1:], False]
    right = np.clip(np.searchsorted(series.time, grid), 1, len(series.time) - 1)
    gap = series.time[right] - series.time[right - 1] > gap_limit(series.time)
    exact = np.isclose(grid, series.time[right], rtol=0.0, atol=1e-7)
    left = np.where(exact, right, right - 1)
    return np.asarray(gap), np.asarray(doubtful[left] | doubtful[right])


def with_impossible_readings(name: str, series: Series) -> Series:
    """Return a series whose doubts include readings that the sensors of a quantity cannot have."""
    if name == "attitude":
        norm = np.linalg.norm(series.values, axis=1)
        return with_doubt(series, "no unit quaternion", np.abs(norm - 1.0) > NORM_ERROR)
    if name == "gps":
        return with_doubt(series, "no fix", np.asarray((series.values[:, :2] == 0.0).all(axis=1)))  # 0 N 0 E
    if name == "omega":
        omega = np.nan_to_num(series.values)
        outside = np.abs(omega).max(axis=1) > GYRO_LIMIT
        if len(omega) > 5 and np.median(np.diff(series.time)) <= SPIKE_PERIOD:
            outside |= np.abs(omega - median_filter(omega, (5, 1), mode="nearest")).max(axis=1) > SPIKE
        return with_doubt(series, "gyroscope out of range", outside)
    if name == "specific_force":
        outside = np.abs(np.nan_to_num(series.values)).max(axis=1) > ACCELEROMETER_LIMIT
        return with_doubt(series, "accelerometer out of range", outside)
    return series


def with_doubt(series: Series, cause: str, mask: np.ndarray) -> Series:
    """Return a series with one more reason to doubt samples."""
    known = series.doubts.get(cause, False)
    return replace(series, doubts={**series.doubts, cause: known | mask}) if mask.any() else series


def with_jumps(chosen: Mapping[str, Series]) -> dict[str, Series]:
    """Return the sources of a flight with jumps of position, velocity and attitude among the resets.

    A position jumps if it changes by far more than the velocity allows, an attitude likewise by the gyroscope. Jumps
    that the log itself names as resets are counted once.
    """
    result = dict(chosen)
    find = {"position": _position_jumps, "velocity": _velocity_jumps, "attitude": _attitude_jumps}
    partner = {"position": "velocity", "velocity": "velocity", "attitude": "omega"}
    for name, jumps_of in find.items():
        if name not in chosen or len(chosen[name].time) < 5:
            continue
        believed = np.flatnonzero(chosen[name].believed)
        if len(believed) < 5:
            continue
        found = np.zeros(len(chosen[name].time), bool)
        other = chosen.get(partner[name])
        found[believed[1:]] = jumps_of(chosen[name].select(chosen[name].believed), other and other.kept())
        known = np.logical_or.reduce([np.zeros_like(found), *chosen[name].resets.values()])
        found &= ~widen(known, NEIGHBOURS)
        if found.any():
            result[name] = replace(chosen[name], resets={**chosen[name].resets, f"{name} jump": found})
    return result


def _beyond(difference: np.ndarray, limit: np.ndarray) -> np.ndarray:
    """Return True for differences above the limit and above noise, shape (n,)."""
    return np.asarray(difference > limit + NOISY * np.median(difference))


def _position_jumps(position: Series, velocity: Series | None) -> np.ndarray:
    step = np.diff(position.time)
    rate = np.diff(position.values, axis=0) / step[:, None]
    if velocity is not None and len(velocity.time) > 1:
        middle = _means(velocity, position.time)
    else:
        middle = median_filter(rate, (5, 1), mode="nearest")
    difference = np.linalg.norm(rate - middle, axis=1) * step
    return _beyond(difference, POSITION_STEP + HELD * np.linalg.norm(middle, axis=1) + FASTEST_CHANGE * step**2)


def _velocity_jumps(velocity: Series, _: Series | None) -> np.ndarray:
    step = np.diff(velocity.time)
    change = np.linalg.norm(np.diff(velocity.values, axis=0), axis=1)
    return _beyond(change, VELOCITY_STEP + FASTEST_ACCELERATION * step)


def _attitude_jumps(attitude: Series, omega: Series | None) -> np.ndarray:
    step = np.diff(attitude.time)
    q = continuous(unit(attitude.values))
    turn = rotation_vector(product(conjugate(q[:-1]), q[1:]))
    expected = _means(omega, attitude.time) if omega is not None and len(omega.time) > 1 else np.zeros_like(turn)
    difference = np.linalg.norm(turn - expected * step[:, None], axis=1)
    return _beyond(difference, ATTITUDE_STEP + HELD * np.linalg.norm(expected, axis=1) + FASTEST_TURN * step**2)


def _means(series: Series, time: np.ndarray) -> np.ndarray:
    """Return the means of a series between each two of the times [s], shape (len(time) - 1, k)."""
    every = np.union1d(series.time, time)
    values = series.at(every)
    integral = np.zeros_like(values)
    integral[1:] = np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(every)[:, None], axis=0)
    at = integral[np.searchsorted(every, time)]
    return np.asarray(np.diff(at, axis=0) / np.diff(time)[:, None])


def velocity_error(position: Series, velocity: Series) -> tuple[float, float]:
    """Return the median difference of a velocity from the derivative of the position, and the median speed [m/s]."""
    position = position.kept()
    if len(position.time) < 5 or len(velocity.time) < 2:
        return 0.0, 0.0
    rate = np.diff(position.values, axis=0) / np.diff(position.time)[:, None]
    error = np.linalg.norm(_means(velocity, position.time) - rate, axis=1)
    moving = np.linalg.norm(rate, axis=1)
    fast = moving >= np.median(moving)
    return float(np.median(error[fast])), float(np.median(moving[fast]))


def check_velocity(position: Series | None, velocity: Series | None) -> str:
    """Return a remark on a velocity that contradicts the derivative of the position, "" if it does not."""
    if position is None or velocity is None:
        return ""
    error, speed = velocity_error(position, velocity.kept())
    if error <= SLOW + SHARE * speed:
        return ""
    return f"velocity is {error:.2f} m/s from the derivative of the position at {speed:.2f} m/s; check its frame"


def check_twist(path: Path, source: str, frame: str, candidates: Mapping[str, Series], position: Series) -> None:
    """Raise ValueError if the velocity of an odometry contradicts the derivative of its position.

    Args:
        path: path of the log.
        source: name of the topic.
        frame: frame of the velocity by the definition of the message, "body" or "world".
        candidates: velocity in the world under the assumption of each frame.
        position: position of the same messages.
    """
    errors = {name: velocity_error(position, velocity)[0] for name, velocity in candidates.items()}
    speed = velocity_error(position, candidates[frame])[1]
    if errors[frame] <= SLOW + SHARE * speed:
        return
    measured = ", ".join(f"{error:.2f} m/s if in {name} axes" for name, error in errors.items())
    best = min(errors, key=errors.__getitem__)
    use = best if errors[best] <= SLOW + SHARE * speed else "none"
    raise ValueError(
        f"{path}: the twist of {source} contradicts the derivative of its position ({measured}); "
        f"use --twist-frame {use}"
    )
