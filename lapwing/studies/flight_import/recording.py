"""Recorded flight on a uniform time grid, in SI units, world ENU and body FLU."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np

LONGEST_GAP = 0.035  # [s] largest time between two samples for interpolation
LONGEST_HOLD = 0.5  # [s] largest time between two messages for valid interpolation
GYRO_LIMIT = 35.0  # [rad/s] range of common gyroscopes, 2000 deg/s
LOWEST = 0.3  # [m] minimum height of an airborne vehicle
RESTART = 1.0  # [s] step backwards above which a clock has restarted
RESOLUTION = 1e-6  # [s] resolution of time stamps
SETPOINT_WIDTH = 11  # number of columns of a setpoint


@dataclass(frozen=True)
class Series:
    """Time series.

    Attributes:
        time: times [s] of the log's clock, increasing, shape (n,).
        values: values, shape (n, k).
        dropped: number of samples omitted because their time does not increase.
    """

    time: np.ndarray
    values: np.ndarray
    dropped: int = 0

    @classmethod
    def of(cls, time: Any, values: Any) -> Self:
        """Return the samples whose time is finite and later than all previous ones.

        Single times far ahead are omitted first: one damaged time stamp must not hide the rest of the flight.
        """
        time, values = np.asarray(time, float), np.asarray(values, float)
        values = values.reshape(len(time), -1)
        plausible = np.where(time_spikes(time) & (time > np.r_[time[1:], np.inf]), np.nan, time)
        later = np.isfinite(plausible) & (
            plausible > np.r_[-np.inf, np.maximum.accumulate(np.nan_to_num(plausible, nan=-np.inf))[:-1]]
        )
        return cls(time[later], values[later], int((~later).sum()))

    def at(self, grid: np.ndarray) -> np.ndarray:
        """Return linearly interpolated values at the times `grid` [s], shape (len(grid), k)."""
        return np.column_stack([np.interp(grid, self.time, column) for column in self.values.T])

    def latest(self, grid: np.ndarray) -> np.ndarray:
        """Return the latest values at the times `grid` [s], shape (len(grid), k); NaN if older than `LONGEST_HOLD`."""
        row = np.searchsorted(self.time, grid + RESOLUTION, side="right") - 1
        values = self.values[np.maximum(row, 0)].copy()
        values[(row < 0) | (grid - self.time[np.maximum(row, 0)] > LONGEST_HOLD)] = np.nan
        return values

    def near(self, grid: np.ndarray) -> np.ndarray:
        """Return True for times of `grid` [s] with neighbours at most `LONGEST_HOLD` apart, shape (len(grid),)."""
        right = np.clip(np.searchsorted(self.time, grid), 1, len(self.time) - 1)
        return np.asarray(self.time[right] - self.time[right - 1] <= LONGEST_HOLD)


def time_spikes(time: np.ndarray) -> np.ndarray:
    """Return True for times out of order whose two neighbours are in order, shape (n,)."""
    before, after = np.r_[-np.inf, time[:-1]], np.r_[time[1:], np.inf]
    return np.asarray((before < after) & ((time > after) | (time < before)))


def longest_session(time: np.ndarray) -> tuple[np.ndarray, int]:
    """Return the mask of the longest part between two restarts of the clock, shape (n,), and the number of parts.

    Args:
        time: times [s] in the order of recording, shape (n,); NaN for samples without one.
    """
    known = np.flatnonzero(np.isfinite(time))
    known = known[~time_spikes(time[known])]
    restarts = known[1:][np.diff(time[known]) < -RESTART]
    session = np.searchsorted(restarts, np.arange(len(time)), side="right")
    return session == np.bincount(session).argmax(), len(restarts) + 1


def session_notes(sessions: int) -> list[str]:
    """Return the remark on a log of several sessions."""
    if sessions == 1:
        return []
    return [f"the clock restarts {sessions - 1} times: the longest of {sessions} parts; cut the file for the others"]


def convert(source: Series | None, change: Callable[[np.ndarray], np.ndarray]) -> Series | None:
    """Return a series with converted values, or None for None."""
    return source and replace(source, values=change(source.values))


@dataclass(frozen=True)
class Recording:
    """One flight of one vehicle; n samples.

    Attributes:
        name: name of the flight, the file name without extensions.
        interval: time between two samples [s].
        position: position [m], world, shape (n, 3); NaN if not measured.
        attitude: unit quaternions w, x, y, z, body to world, shape (n, 4); NaN if not measured.
        velocity: velocity [m/s], world, shape (n, 3).
        omega: angular velocity [rad/s], body, shape (n, 3).
        specific_force: specific force [m/s^2], body, shape (n, 3); NaN if not measured.
        motor_voltage: voltage of each motor [V], shape (n, rotors).
        battery_voltage: battery voltage [V], shape (n,).
        valid: True for samples that are valid in all channels, shape (n,).
        power: power from the battery [W], shape (n,); NaN if not measured.
        setpoint: desired position [m], velocity [m/s] and acceleration [m/s^2] in the world, yaw [rad] and its rate
            [rad/s], shape (n, 11); NaN without a setpoint, empty if not recorded.
        attitude_setpoint: desired roll, pitch and yaw [rad], shape (n, 3); NaN without a setpoint, empty if not
            recorded.
        faults: number of invalid samples by cause.
        notes: time offset and other remarks on the import, a line each.
        readings: other sensors of the log by name (see `write_log.SENSORS`), at their rates.
        unknown: names of the log's messages without a counterpart.
    """

    name: str
    interval: float
    position: np.ndarray
    attitude: np.ndarray
    velocity: np.ndarray
    omega: np.ndarray
    specific_force: np.ndarray
    motor_voltage: np.ndarray
    battery_voltage: np.ndarray
    valid: np.ndarray
    power: np.ndarray = field(default_factory=lambda: np.empty(0))
    setpoint: np.ndarray = field(default_factory=lambda: np.empty((0, SETPOINT_WIDTH)))
    attitude_setpoint: np.ndarray = field(default_factory=lambda: np.empty((0, 3)))
    faults: dict[str, int] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    readings: Mapping[str, Series] = field(default_factory=dict)
    unknown: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.valid)

    @property
    def rotors(self) -> int:
        """Number of rotors."""
        return int(self.motor_voltage.shape[1])

    def repeats(self, other: Self) -> bool:
        """Return True if the valid measurements equal those of another recording, also of a file in another format."""
        if len(self) != len(other):
            return False
        valid = self.valid & other.valid
        return bool(valid.any()) and all(
            np.allclose(own[valid], others[valid], rtol=0.0, atol=1e-9, equal_nan=True)
            for own, others in ((self.omega, other.omega), (self.position, other.position))
        )

    @property
    def obstacles(self) -> list[str]:
        """Reasons why no part of the flight can be validated."""
        unmeasured = [name for name in ("position", "attitude") if not np.isfinite(getattr(self, name)).any()]
        reasons = [f"no {name}" for name in unmeasured]
        height = self.position[self.valid & np.isfinite(self.position[:, 2]), 2]
        if not np.nanmax(self.motor_voltage, initial=0.0) > 0.0:
            reasons.append("never leaves the ground, the motors do not run")
        elif len(height) and height.max() < LOWEST and np.ptp(height) < LOWEST:
            reasons.append(f"never leaves the ground, the height changes by {np.ptp(height):.2f} m")
        return reasons


def widen(invalid: np.ndarray, samples: int) -> np.ndarray:
    """Return the mask extended by `samples` neighbours on either side of each True sample."""
    return np.convolve(invalid, np.ones(2 * samples + 1), "same") > 0.5
