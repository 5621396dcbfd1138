"""Recorded flight on a uniform time grid, in SI units, world ENU and body FLU."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, Self

import numpy as np

LONGEST_GAP = 0.035  # [s] largest time between two samples for interpolation
LONGEST_HOLD = 0.5  # [s] largest age of a setpoint
GYRO_LIMIT = 35.0  # [rad/s] range of common gyroscopes, 2000 deg/s
LOWEST = 0.3  # [m] minimum height of an airborne vehicle
RESTART = 1.0  # [s] step backwards above which a clock has restarted
RESOLUTION = 1e-6  # [s] resolution of time stamps
ELLIPSOID, SEA_LEVEL = "ellipsoid", "mean sea level"  # datums of heights
SETPOINT_WIDTH = 11  # number of columns of a setpoint
Masks = Iterable[tuple[str, np.ndarray]]  # pairs (cause, mask of samples)


@dataclass(frozen=True)
class Series:
    """Time series of one source of a log, with what the log says about it.

    Attributes:
        time: times [s] of the log's clock, increasing, shape (n,).
        values: values, shape (n, k).
        dropped: number of samples omitted because their time does not increase.
        source: name of the log's messages.
        instance: number of the sensor or estimator among several of the source, None for a single one.
        frame: axes of the log, or direction of a sensor ("down").
        datum: origin of heights.
        doubts: masks of samples that are not to be believed by cause, shape (n,) each.
        resets: masks of first samples after the estimator has moved by cause, shape (n,) each.
    """

    time: np.ndarray
    values: np.ndarray
    dropped: int = 0
    source: str = ""
    instance: int | None = None
    frame: str = ""
    datum: str = ""
    doubts: Mapping[str, np.ndarray] = field(default_factory=dict)
    resets: Mapping[str, np.ndarray] = field(default_factory=dict)

    @classmethod
    def of(cls, time: Any, values: Any, doubts: Masks = (), resets: Masks = (), **labels: Any) -> Self:
        """Return the samples whose time is finite and later than all previous ones.

        Single times far ahead are omitted first: one damaged time stamp must not hide the rest of the flight.

        Args:
            time: times [s], shape (n,).
            values: values, shape (n, k) or (n,).
            doubts: pairs (cause, mask) of samples not to believe; a cause may occur twice.
            resets: pairs (cause, mask) of first samples after a reset.
            labels: `source`, `instance`, `frame` and `datum`.
        """
        time, values = np.asarray(time, float), np.asarray(values, float)
        values = values.reshape(len(time), -1)
        plausible = np.where(time_spikes(time) & (time > np.r_[time[1:], np.inf]), np.nan, time)
        later = np.isfinite(plausible) & (
            plausible > np.r_[-np.inf, np.maximum.accumulate(np.nan_to_num(plausible, nan=-np.inf))[:-1]]
        )
        doubtful: dict[str, np.ndarray] = {}
        for cause, mask in doubts:
            doubtful[cause] = doubtful.get(cause, False) | np.asarray(mask, bool)[later]
        moved: dict[str, np.ndarray] = {}
        for cause, mask in resets:  # a reset at an omitted sample is one at the next
            count = np.cumsum(mask)[later]
            moved[cause] = moved.get(cause, False) | (np.diff(count, prepend=count[:1]) > 0)
        return cls(time[later], values[later], int((~later).sum()), doubts=doubtful, resets=moved, **labels)

    def at(self, grid: np.ndarray) -> np.ndarray:
        """Return linearly interpolated values at the times `grid` [s], shape (len(grid), k)."""
        return np.column_stack([np.interp(grid, self.time, column) for column in self.values.T])

    def means(self, grid: np.ndarray, interval: float) -> np.ndarray:
        """Return the means of held values over `interval` [s] from each time of `grid` [s], shape (len(grid), k)."""
        total = np.zeros_like(self.values)
        np.cumsum(self.values[:-1] * np.diff(self.time)[:, None], axis=0, out=total[1:])

        def integral(time: np.ndarray) -> np.ndarray:
            row = np.maximum(np.searchsorted(self.time, time, side="right") - 1, 0)
            return np.asarray(total[row] + self.values[row] * (time - self.time[row])[:, None])

        return (integral(grid + interval) - integral(grid)) / interval

    def latest(self, grid: np.ndarray) -> np.ndarray:
        """Return the latest values at the times `grid` [s], shape (len(grid), k); NaN if older than `LONGEST_HOLD`."""
        row = np.searchsorted(self.time, grid + RESOLUTION, side="right") - 1
        values = self.values[np.maximum(row, 0)].copy()
        values[(row < 0) | (grid - self.time[np.maximum(row, 0)] > LONGEST_HOLD)] = np.nan
        return values

    @property
    def believed(self) -> np.ndarray:
        """True for finite samples that the log does not doubt, shape (n,)."""
        doubtful = np.logical_or.reduce([np.zeros(len(self.time), bool), *self.doubts.values()])
        return np.asarray(~doubtful & np.isfinite(self.values).all(axis=1))

    def kept(self) -> Self:
        """Return the believed samples."""
        return self.select(self.believed)

    def select(self, mask: np.ndarray) -> Self:
        """Return the samples of a mask, without doubts and resets."""
        return replace(self, time=self.time[mask], values=self.values[mask], doubts={}, resets={})


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


class SourceRow(NamedTuple):
    """Row of the table of an import."""

    signal: str
    source: str
    instance: str
    datum: str
    frame: str
    samples: int
    left_out: str  # numbers and causes


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
        sources: sources of the quantities, as a table.
        notes: time offset and other remarks on the import, a line each.
        readings: other sensors of the log by name (see `write_log.SENSORS`), at their rates.
        unknown: names of the log's messages without a counterpart.
        has_shares: True if `motor_voltage` has shares of the full voltage, which the log does not have.
        firmware: "px4" or "ardupilot" if the motors are numbered as this firmware does; "": in the airframe's order.
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
    sources: tuple[SourceRow, ...] = ()
    notes: tuple[str, ...] = ()
    readings: Mapping[str, Series] = field(default_factory=dict)
    unknown: tuple[str, ...] = ()
    has_shares: bool = False
    firmware: str = ""

    def __len__(self) -> int:
        return len(self.valid)

    def in_volts(self, full: float) -> Self:
        """Return the flight with motor voltages in volts; `full`: voltage of the vehicle [V] if the log has none."""
        if not self.has_shares:
            return self
        return replace(self, motor_voltage=full * self.motor_voltage, has_shares=False)

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
    def missing(self) -> list[str]:
        """Names of the quantities of the motion that the log does not have."""
        return [n for n in ("position", "velocity", "attitude") if not np.isfinite(getattr(self, n)).any()]

    @property
    def obstacle(self) -> str:
        """Reason why no part of the flight can be validated, "" without one."""
        height = self.position[self.valid & np.isfinite(self.position[:, 2]), 2]
        if not np.nanmax(self.motor_voltage, initial=0.0) > 0.0:
            return "never leaves the ground, the motors do not run"
        if len(height) and height.max() < LOWEST and np.ptp(height) < LOWEST:
            return f"never leaves the ground, the height changes by {np.ptp(height):.2f} m"
        return ""


def widen(invalid: np.ndarray, samples: int) -> np.ndarray:
    """Return the mask extended by `samples` neighbours on either side of each True sample."""
    return np.convolve(invalid, np.ones(2 * samples + 1), "same") > 0.5
