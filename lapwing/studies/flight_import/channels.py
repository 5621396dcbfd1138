"""Time series of a log with separate times for each quantity, and their conversion to a recording."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from lapwing.studies.flight_import.recording import Recording, Series
from lapwing.studies.flight_import.time_alignment import describe
from lapwing.studies.rotation_arrays import body_rate, continuous, unit

RATE = 100.0  # [Hz] sampling rate of the recording
SHORTEST = 1.0  # [s] minimum duration of a recording
SPARSEST = 100  # largest ratio of samples of the grid to samples of the log
FLU = np.array([1.0, -1.0, -1.0])  # signs from FRD to FLU, and back


@dataclass
class Channels:
    """Quantities of one vehicle's log in SI units, world ENU and body FLU; None for missing ones.

    Attributes:
        attitude: quaternions w, x, y, z, body to world.
        position: position [m], world.
        velocity: velocity [m/s], world.
        omega: angular velocity [rad/s], body.
        specific_force: specific force [m/s^2], body.
        duty: throttle of each motor, 0 to 1.
        battery: voltage [V], and current [A] as a second column if measured.
        setpoint: setpoint of position and its derivatives, with the columns of `Recording.setpoint`.
        attitude_setpoint: setpoint of roll, pitch, yaw [rad].
        readings: readings of sensors by the keys of `SENSORS` in `write_log`.
        notes: remarks on the import, a line each.
        unknown: names of topics without a counterpart.
    """

    attitude: Series | None = None
    position: Series | None = None
    velocity: Series | None = None
    omega: Series | None = None
    specific_force: Series | None = None
    duty: Series | None = None
    battery: Series | None = None
    setpoint: Series | None = None
    attitude_setpoint: Series | None = None
    readings: dict[str, Series] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    unknown: Sequence[str] = ()


def to_recording(path: Path, channels: Channels, motors: str, rates: str) -> Recording:
    """Sample all quantities at 100 Hz, over the common time span of rates, motors, attitude and position.

    Args:
        path: path of the log, for messages.
        channels: quantities of the log.
        motors: names of messages with motor outputs, for messages.
        rates: names of messages with angular rates, for messages.

    Raises:
        ValueError: motor outputs or rates are missing, or the flight is too short.
    """
    if channels.duty is None or len(channels.duty.time) < 2:
        raise ValueError(f"{path}: no motor outputs ({motors}); log them and fly again")
    if channels.omega is None or len(channels.omega.time) < 2:
        raise ValueError(f"{path}: no rates ({rates}); log them and fly again")
    channels.battery, unmeasured = _with_voltage(channels.battery)
    names = ("attitude", "position", "velocity", "omega", "specific_force", "duty", "battery")
    series = {name: s for name in names if (s := getattr(channels, name)) is not None and len(s.time) > 1}
    common = [series[name] for name in ("attitude", "position", "omega", "duty") if name in series]
    begin, end = max(s.time[0] for s in common), min(s.time[-1] for s in common)
    if end - begin < SHORTEST:
        raise ValueError(f"{path}: its messages overlap for {max(end - begin, 0.0):.1f} s; expected a flight")
    check_density(path, (end - begin) * RATE, max(len(s.time) for s in common))
    grid = np.arange(begin, end, 1.0 / RATE)
    if "attitude" in series:
        attitude = series["attitude"]
        series["attitude"] = Series(attitude.time, continuous(unit(attitude.values)))
    sampled = {name: s.at(grid) for name, s in series.items()}
    valid = np.logical_and.reduce([s.near(grid) for name, s in series.items() if name != "battery"])
    notes = list(channels.notes)

    def values(name: str, width: int) -> np.ndarray:
        if name in sampled:
            return sampled[name]
        return np.full((len(grid), width), np.nan)

    position, omega, duty = values("position", 3), sampled["omega"], np.clip(sampled["duty"], 0.0, 1.0)
    quaternion = unit(values("attitude", 4))
    velocity = sampled.get("velocity", np.gradient(position, grid, axis=0))
    battery, power = _battery(sampled.get("battery"), len(grid))
    if not np.isfinite(battery).all():
        notes.append("no battery voltage: motor voltages are shares of the full voltage")
    if "attitude" in series:
        attitude_rate = body_rate(quaternion, np.full(len(grid), 1.0 / RATE))
        notes.append(describe(attitude_rate, omega, valid, 1.0 / RATE))
        check_rate_unit(path, attitude_rate, omega, valid)
    finite = np.isfinite(np.column_stack([sampled[name] for name in series if name != "battery"])).all(axis=1)
    faults = {
        "gap in a topic": int((~valid).sum()),
        "not finite": int((~finite).sum()),
        "battery not measured": unmeasured,
        "time not increasing": sum(s.dropped for s in (getattr(channels, name) for name in names) if s is not None),
    }
    volts = duty * np.where(np.isfinite(battery), battery, 1.0)[:, None]
    readings = {name: Series(s.time - begin, s.values) for name, s in channels.readings.items()}
    desired = {
        name: s.latest(grid)
        for name in ("setpoint", "attitude_setpoint")
        if (s := getattr(channels, name)) is not None and len(s.time)
    }
    return Recording(
        path.stem, 1.0 / RATE, position, quaternion, velocity, omega, values("specific_force", 3), volts, battery,
        valid & finite, power, faults={cause: count for cause, count in faults.items() if count},
        notes=tuple(notes), readings=readings, unknown=tuple(channels.unknown), **desired,
    )  # fmt: skip


def check_density(path: Path, samples: float, recorded: int) -> None:
    """Raise ValueError for damaged times, whose uniform grid would need many times the memory of the file.

    Args:
        path: path of the log.
        samples: number of samples of the grid.
        recorded: number of samples of the log.
    """
    if not samples <= SPARSEST * recorded:
        raise ValueError(
            f"{path}: time is damaged, {recorded} samples for {samples:.0f}; cut the file before the damage"
        )


def _with_voltage(battery: Series | None) -> tuple[Series | None, int]:
    """Return the readings with a voltage above 0, None if there are none, and the number of the others."""
    if battery is None:
        return None, 0
    measured = battery.values[:, 0] > 0.0
    result = Series(battery.time[measured], battery.values[measured], battery.dropped)
    return result if measured.any() else None, int((~measured).sum())


def _battery(values: np.ndarray | None, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the voltage [V] without short dips, and the power [W], shape (n,) each; NaN if not measured."""
    from scipy.ndimage import median_filter

    unmeasured = np.full(n, np.nan)
    if values is None:
        return unmeasured, unmeasured
    volts = median_filter(values[:, 0], 31, mode="nearest")
    return volts, values[:, 0] * values[:, 1] if values.shape[1] > 1 else unmeasured


def check_rate_unit(path: Path, attitude_rate: np.ndarray, omega: np.ndarray, valid: np.ndarray) -> None:
    """Raise ValueError if the gyroscope [rad/s] seems to be in degrees per second.

    Args:
        path: path of the log, for the message.
        attitude_rate: rate of the measured attitude [rad/s], shape (n, 3).
        omega: rate of the gyroscope [rad/s], shape (n, 3).
        valid: samples to compare, shape (n,).
    """
    if valid.sum() < RATE / 2:
        return
    measured, expected = np.nanstd(omega[valid]), np.nanstd(attitude_rate[valid])
    if expected > 0.05 and measured > 15.0 * expected:
        message = f"gyroscope is {measured / expected:.0f} times the rate of the attitude"
        raise ValueError(f"{path}: {message}, deg/s is suspected; set omega.unit in the mapping")
