"""Sensor noise, bias and latency of a recorded flight, as parameters of the sensor models.

White noise is measured by second differences of samples, which are insensitive to bias, drift and smooth motion. It is
measured while the vehicle rests, if it rests for `SHORTEST_REST`; otherwise in flight, where it includes vibration.
Slow errors are the largest Allan deviation beyond that of the white noise (IEEE Std 952). The latency is the time shift
with the best fit to the measured motion.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from lapwing.dynamics.constants import STANDARD_GRAVITY
from lapwing.dynamics.geodesy import Home, geodetic_to_enu
from lapwing.flights.log_import.recording import Recording, Series
from lapwing.flights.log_import.time_alignment import time_offset
from lapwing.flights.rotation_arrays import body_rate
from lapwing.services.sensors.delay_line import DEPTH

SHORTEST_REST = 2.0  # [s] minimum time without motor commands that counts as rest
LONG_REST = 100.0  # [s] minimum rest for the estimation of slow errors of the IMU
FEWEST = 20  # minimum number of samples of a sensor
RESTING = 0.02  # share of the highest motor voltage below which the vehicle rests
MOST_BIAS_G = 0.3  # [g] largest difference of the specific force from gravity that a bias can explain
MOST_BIAS_RAD_S = 0.5  # [rad/s] largest rate of the gyroscope that a bias can explain
CLEAR = 0.8  # minimum correlation of a significant latency
LONGEST_LATENCY = 0.5  # [s]
SIGNIFICANT = 3.3  # standard errors of an Allan variance
MOVING = 0.2  # [m/s] minimum rms speed for the estimation of the latency of positions


def fit_all(flights: Sequence[Recording]) -> tuple[dict[str, dict[str, Any]], list[str]]:
    """Return the median of each parameter over flights, and each remark once with its number of flights.

    Raises:
        ValueError: no flight has a sensor.
    """
    fits: list[dict[str, dict[str, Any]]] = []
    notes: dict[str, list[str]] = {}  # names of flights by remark
    for flight in flights:
        result, remarks = fit_sensors(flight)
        fits.append(result)
        for remark in remarks:
            notes.setdefault(remark, []).append(flight.name)
    if not any(fits):
        raise ValueError("no flight has sensors (imu, mag, baro, gps); use a log with gyroscope and accelerometer")
    lines = [
        f"{remark} ({names[0] if len(names) == 1 else f'{len(names)} flights'})" for remark, names in notes.items()
    ]
    return _median(fits), lines


def _median(tables: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    out: dict[str, Any] = {}
    for key in dict.fromkeys(key for table in tables for key in table):
        values = [table[key] for table in tables if key in table]
        if isinstance(values[0], Mapping):
            out[key] = _median(values)
        else:
            middle = float(np.median(values))
            out[key] = round(middle) if isinstance(values[0], int) else float(f"{middle:.4g}")
    return out


def fit_sensors(flight: Recording) -> tuple[dict[str, dict[str, Any]], list[str]]:
    """Return the parameters of each sensor in the flight, and remarks on undetermined ones.

    Args:
        flight: recording with raw sensors in its `readings`, or an IMU in its samples.
    """
    out: dict[str, dict[str, Any]] = {}
    notes: list[str] = []
    rest = _rest(flight)
    if rest is None:
        notes.append(f"no {SHORTEST_REST:g} s at rest with motors off: noise is measured in flight, with vibration")
    readings = {"imu": _imu_of_samples(flight), **flight.readings}
    series = {name: s for name, s in readings.items() if len(s.time) >= FEWEST}
    located = bool(np.isfinite(flight.position).all(axis=1).any())
    if "imu" in series:
        out["imu"] = _imu(flight, series["imu"], rest, notes)
    if "mag" in series:
        s = series["mag"]
        out["magnetometer"] = {"noise_nt_per_sqrt_hz": _density(_within(s, rest)) * 1e9, "rate": _rate(s)}
    if "baro" in series:
        s = series["baro"]
        out["barometer"] = {"noise_pa_per_sqrt_hz": _density(s), "rate": _rate(s)}
        if located:
            out["barometer"]["bias_instability_pa"] = _slow(_pressure_error(flight, s))
    if "gps" in series and located:
        out["gps"] = _gps(flight, series["gps"], notes)
    return out, notes


def _imu_of_samples(flight: Recording) -> Series:
    """Return rate and specific force of the flight's samples, for CSV files, in which the IMU has no separate rate."""
    values = np.column_stack([flight.omega, flight.specific_force])
    usable = flight.valid & np.isfinite(values).all(axis=1)
    return Series(_grid(flight)[usable], values[usable])


def _imu(flight: Recording, s: Series, rest: tuple[float, float] | None, notes: list[str]) -> dict[str, Any]:
    still = _within(s, rest)
    degrees, mg = 180.0 / math.pi, 1e3 / STANDARD_GRAVITY
    omega = Series(still.time, still.values[:, :3] * degrees)
    force = Series(still.time, still.values[:, 3:] * mg)
    gyro = {"noise_dps_per_sqrt_hz": _density(omega)}
    accelerometer = {"noise_mg_per_sqrt_hz": _density(force)}
    if rest is not None:
        gyro["turn_on_bias_dps"] = float(np.sqrt(np.mean(omega.values.mean(axis=0) ** 2)))
        excess = np.linalg.norm(force.values.mean(axis=0)) - 1e3
        accelerometer["turn_on_bias_mg"] = float(abs(excess))
        if rest[1] - rest[0] >= LONG_REST:
            gyro["bias_instability_deg_per_h"] = 3600.0 * _slow(omega)
            accelerometer["bias_instability_ug"] = 1e3 * _slow(force)
        else:
            notes.append(f"imu: bias instability unknown, needs {LONG_REST:g} s at rest")
    result: dict[str, Any] = {"gyro": gyro, "accelerometer": accelerometer, "rate": _rate(s)}
    attitude_rate = body_rate(flight.attitude, np.full(len(flight), flight.interval))
    measured = np.column_stack([np.interp(_grid(flight), s.time, c) for c in s.values[:, :3].T])
    if np.isfinite(flight.attitude).all():
        # the rate from two attitudes is that at the midpoint, half an interval before the sample
        lag, correlation = time_offset(attitude_rate, measured, flight.valid, flight.interval)
        lag += 0.5 * flight.interval
        if correlation > CLEAR:
            result["latency_samples"] = _samples(lag, result["rate"])
        else:
            notes.append(f"imu: latency unknown, correlation with the attitude is below {CLEAR:g}")
    return result


def _gps(flight: Recording, s: Series, notes: list[str]) -> dict[str, Any]:
    home = Home(*s.values[0].tolist())
    fixes = Series(s.time, np.array([geodetic_to_enu(home, *row) for row in s.values.tolist()]))
    rate = _rate(s)
    result: dict[str, Any] = {"rate": rate}
    speed = math.sqrt(float(np.nanmean(np.sum(flight.velocity[flight.valid] ** 2, axis=1))))
    lag = 0.0
    if speed > MOVING:
        lags = np.arange(0.0, LONGEST_LATENCY, 0.5 * flight.interval)
        lag = float(min(lags, key=lambda shift: float(np.var(_position_error(flight, fixes, shift), axis=0).sum())))
        result["latency_samples"] = _samples(lag, rate)
    else:
        notes.append(f"gps: latency unknown, the vehicle moves at {speed:.2f} m/s; fly faster than {MOVING:g} m/s")
    error = _position_error(flight, fixes, lag)
    white = np.array([_white(error[:, k : k + 1]) for k in range(3)])
    density = white / math.sqrt(0.5 * rate)
    result["noise_horizontal_m_per_sqrt_hz"] = float(np.sqrt(np.mean(density[:2] ** 2)))
    result["noise_vertical_m_per_sqrt_hz"] = float(density[2])
    slow = np.sqrt(np.maximum(np.var(error, axis=0) - white**2, 0.0))
    result["correlated_error_horizontal"] = float(np.sqrt(np.mean(slow[:2] ** 2)))
    result["correlated_error_vertical"] = float(slow[2])
    return result


def _position_error(flight: Recording, fixes: Series, lag: float) -> np.ndarray:
    """Return fixes minus the measured position at their times of validity, [m] world, shape (n, 3)."""
    valid_time = fixes.time - lag
    inside = (valid_time >= 0.0) & (valid_time <= flight.interval * (len(flight) - 1))
    position = np.column_stack([np.interp(valid_time[inside], _grid(flight), c) for c in flight.position.T])
    return fixes.values[inside] - position


def _pressure_error(flight: Recording, s: Series) -> Series:
    """Return the pressure [Pa] minus a linear function of height."""
    height = np.interp(s.time, _grid(flight), flight.position[:, 2])
    basis = np.column_stack([np.ones_like(height), height])
    line, *_ = np.linalg.lstsq(basis if np.ptp(height) > 0.1 else basis[:, :1], s.values[:, 0], rcond=None)
    return Series(s.time, s.values - (basis[:, : len(line)] @ line)[:, None])


def _rest(flight: Recording) -> tuple[float, float] | None:
    """Return start and end [s] of the longest rest, or None. A vehicle that falls or turns over is not at rest."""
    volts = np.nan_to_num(flight.motor_voltage).max(axis=1)
    off = volts < RESTING * max(volts.max(initial=0.0), 1e-9)
    weight = np.abs(np.linalg.norm(flight.specific_force, axis=1) / STANDARD_GRAVITY - 1.0)
    moves = (weight > MOST_BIAS_G) | (np.abs(flight.omega) > MOST_BIAS_RAD_S).any(axis=1)  # False for NaN
    still = np.r_[False, off & ~moves, False]
    edges = np.flatnonzero(np.diff(still.astype(int))).reshape(-1, 2) * flight.interval
    if not len(edges):
        return None
    begin, end = edges[np.argmax(edges[:, 1] - edges[:, 0])]
    return (float(begin), float(end)) if end - begin >= SHORTEST_REST else None


def _within(s: Series, span: tuple[float, float] | None) -> Series:
    if span is None:
        return s
    inside = (s.time >= span[0]) & (s.time < span[1])
    return Series(s.time[inside], s.values[inside]) if inside.sum() >= FEWEST else s


def _rate(s: Series) -> float:
    """Return the rate [Hz] with three significant digits, as in data sheets."""
    return float(f"{1.0 / np.median(np.diff(s.time)):.3g}")


def _samples(lag: float, rate: float) -> int:
    return int(np.clip(round(lag * rate), 0, DEPTH - 1))


def _white(values: np.ndarray) -> float:
    """Return the standard deviation of the white noise of samples, mean over columns, without that of rounding."""
    second = np.diff(values, n=2, axis=0)
    steps = np.abs(np.diff(values, axis=0))
    resolution = steps[steps > 0.0].min(initial=np.inf)
    rounding = resolution**2 / 12.0 if np.isfinite(resolution) else 0.0
    return math.sqrt(max(float(np.mean(second**2)) / 6.0 - rounding, 0.0))


def _density(s: Series) -> float:
    """Return the one-sided spectral density of the white noise, in units of the values per sqrt(Hz)."""
    return _white(s.values) / math.sqrt(0.5 * _rate(s))


def _slow(s: Series) -> float:
    """Return the largest Allan deviation beyond that of the white noise, over averages from 1 s to a ninth of the span.

    An excess that white noise alone causes once in about a thousand spans is ignored.
    """
    white, peak, size = _white(s.values), 0.0, max(round(_rate(s)), 2)
    while 9 * size <= len(s.time):
        means = s.values[: len(s.time) // size * size].reshape(-1, size, s.values.shape[1]).mean(axis=1)
        variance, expected = 0.5 * float(np.mean(np.diff(means, axis=0) ** 2)), white**2 / size
        if variance > expected * (1.0 + SIGNIFICANT * math.sqrt(3.0 / means.size)):  # Allan variances overlap
            peak = max(peak, variance - expected)
        size *= 2
    return math.sqrt(peak)


def _grid(flight: Recording) -> np.ndarray:
    return flight.interval * np.arange(len(flight))
