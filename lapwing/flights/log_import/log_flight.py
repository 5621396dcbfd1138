"""Recordings from Lapwing logs, simulated or imported."""

from pathlib import Path
from typing import Any

import numpy as np

from lapwing.cosim.log.log_reader import LogReader
from lapwing.cosim.log.mcap_contents import UnchunkedError
from lapwing.flights.flight_data import FlightData
from lapwing.flights.log_import.recording import SETPOINT_WIDTH, Recording, Series
from lapwing.flights.rotation_arrays import continuous, from_xyzw, unit
from lapwing.messages.topics import ACTUATORS, BARO, GPS, IMU, MAG, SETPOINT, TRUTH

RATE = 100.0  # [Hz] of the recording
ROUNDING = 1e-6  # [samples] error of a time, so that the last message counts
READINGS = {  # name without the vehicle's, and fields, of each sensor's topic
    "imu": ("imu", ("angular_velocity", "linear_acceleration")),
    "gps": ("gps/fix", ("latitude", "longitude", "altitude")),
    "baro": ("baro", ("fluid_pressure",)),
    "mag": ("mag", ("magnetic_field",)),
}


def is_log(path: Path) -> bool:
    """Return True if an MCAP file is a Lapwing log. Raise ValueError if it cannot be read."""
    try:
        with LogReader(path) as log:
            return bool(log.metadata)
    except UnchunkedError:
        return False


def read_log_flight(path: Path) -> Recording:
    """Read a Lapwing log: motion from its truth, rates from its gyroscope where it has one.

    Raises:
        ValueError: no log, no motion, or no motor outputs in it.
    """
    flight = FlightData.read(path, only=(TRUTH, ACTUATORS, IMU, GPS, BARO, MAG, SETPOINT))
    if not flight.has("actuators") or not len(flight.actuators):
        raise ValueError(f"{path}: no motor outputs (topic actuators); log the motor commands and fly again")
    truth = flight.truth
    times = flight.times("ground_truth")
    interval = 1.0 / RATE
    if len(times) < 2 or times[-1] - times[0] < 50 * interval:
        raise ValueError(f"{path}: shorter than {50 * interval:g} s; expected a flight")
    grid = times[0] + interval * np.arange(int((times[-1] - times[0]) / interval + ROUNDING) + 1)
    volts = Series(flight.times("actuators"), np.asarray(flight.actuators.motor_voltage)).means(grid, interval)
    omega, force = Series(times, truth.angular_velocity).at(grid), np.full((len(grid), 3), np.nan)
    if flight.has("imu") and len(flight.topic("imu")) > 1:
        imu, at = flight.topic("imu"), flight.times("imu")
        omega, force = Series(at, imu.angular_velocity).at(grid), Series(at, imu.linear_acceleration).at(grid)
    quaternion = unit(Series(times, continuous(from_xyzw(truth.orientation))).at(grid))
    battery = np.full(len(grid), np.nan)
    position, velocity = Series(times, truth.position).at(grid), Series(times, truth.velocity).at(grid)
    measured = [v for v in (position, velocity, quaternion) if np.isfinite(v).any()]
    valid = np.isfinite(np.column_stack([*measured, omega, volts])).all(axis=1) & ~_in_gap(grid, times)
    return Recording(
        path.stem, interval, position, quaternion, velocity, omega, force, volts, battery, valid,
        power=_power(grid, times, truth), setpoint=_setpoint(grid, flight), readings=_readings(flight, times[0]),
    )  # fmt: skip


def _in_gap(grid: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return True for times [s] of the grid between two messages that are too far apart, shape (len(grid),).

    An imported log leaves out invalid samples, also single ones next to a reset. Interpolation must not replace them.
    """
    steps = np.diff(times)
    right = np.clip(np.searchsorted(times, grid - ROUNDING / RATE), 1, len(times) - 1)
    is_message = np.minimum(np.abs(times[right] - grid), np.abs(times[right - 1] - grid)) < ROUNDING / RATE
    return np.asarray(~is_message & (steps[right - 1] > 1.5 * float(np.median(steps))))


def _power(grid: np.ndarray, times: np.ndarray, truth: Any) -> np.ndarray:
    """Return the power of all motors [W], NaN if the log has none."""
    power = np.asarray(truth.motor_power)
    if power.ndim < 2 or not power.shape[1]:
        return np.full(len(grid), np.nan)
    return np.interp(grid, times, power.sum(axis=1))


def _setpoint(grid: np.ndarray, flight: FlightData) -> np.ndarray:
    if not flight.has("setpoint") or len(flight.setpoint) < 2:
        return np.empty((0, SETPOINT_WIDTH))
    names = ("position", "velocity", "acceleration", "yaw", "yaw_rate")
    columns = np.column_stack([np.asarray(getattr(flight.setpoint, name)) for name in names])
    return Series.of(flight.times("setpoint"), columns).latest(grid)


def _readings(flight: FlightData, begin: float) -> dict[str, Series]:
    """Return sensor readings at their own instants, without faulty ones."""
    out = {}
    for name, (topic, fields) in READINGS.items():
        if not flight.has(topic) or len(flight.times(topic)) < 2:
            continue
        columns = np.column_stack([np.asarray(getattr(flight.topic(topic), field)) for field in fields])
        finite = np.isfinite(columns).all(axis=1)
        out[name] = Series.of(flight.times(topic)[finite] - begin, columns[finite])
    return out
