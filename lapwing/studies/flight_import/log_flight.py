"""Recordings from Lapwing logs, simulated or imported."""

from pathlib import Path

import numpy as np

from lapwing.messages.topics import ACTUATORS, IMU, TRUTH
from lapwing.studies.flight_data import FlightData
from lapwing.studies.flight_import.recording import Recording
from lapwing.studies.flight_import.rotation_arrays import unit

RATE = 100.0  # [Hz] of the recording


def read_log_flight(path: Path) -> Recording:
    """Read a Lapwing log: motion from its truth, rates from its gyroscope where it has one.

    Raises:
        ValueError: no log, no motion, or no motor outputs in it.
    """
    flight = FlightData.read(path, only=(TRUTH, ACTUATORS, IMU))
    if not flight.has("actuators") or not len(flight.actuators):
        raise ValueError(f"{path}: no motor outputs (topic actuators); log the motor commands and fly again")
    truth = flight.truth
    times = flight.times("ground_truth")
    interval = 1.0 / RATE
    if len(times) < 2 or times[-1] - times[0] < 50 * interval:
        raise ValueError(f"{path}: shorter than {50 * interval:g} s; expected a flight")
    grid = np.arange(times[0], times[-1], interval)
    volts = _latest(grid, flight.times("actuators"), flight.actuators.motor_voltage)
    omega, force = _sampled(grid, times, truth.angular_velocity), np.full((len(grid), 3), np.nan)
    if flight.has("imu") and len(flight.topic("imu")) > 1:
        imu, at = flight.topic("imu"), flight.times("imu")
        omega, force = _sampled(grid, at, imu.angular_velocity), _sampled(grid, at, imu.linear_acceleration)
    quaternion = unit(_sampled(grid, times, _continuous(truth.orientation[:, [3, 0, 1, 2]])))
    battery = np.full(len(grid), np.nan)
    position, velocity = _sampled(grid, times, truth.position), _sampled(grid, times, truth.velocity)
    valid = np.isfinite(np.column_stack([position, velocity, quaternion, omega, volts])).all(axis=1)
    return Recording(path.stem, interval, position, quaternion, velocity, omega, force, volts, battery, valid)


def _sampled(grid: np.ndarray, times: np.ndarray, values: np.ndarray) -> np.ndarray:
    return np.column_stack([np.interp(grid, times, column) for column in np.asarray(values).T])


def _latest(grid: np.ndarray, times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the mean of the values that held over each interval of the grid."""
    fine = 10
    step = grid[1] - grid[0]
    at = grid[:, None] + step * (np.arange(fine) + 0.5) / fine
    index = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 1)
    return np.asarray(values)[index].mean(axis=1)


def _continuous(q: np.ndarray) -> np.ndarray:
    """Return the quaternions with signs that do not jump."""
    flips = np.cumprod(np.where(np.r_[1.0, np.sum(q[1:] * q[:-1], axis=1)] < 0.0, -1.0, 1.0))
    return q * flips[:, None]
