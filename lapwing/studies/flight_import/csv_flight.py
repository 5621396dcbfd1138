"""A recording from the columns of a CSV file and their mapping."""

from pathlib import Path

import numpy as np
from scipy.ndimage import median_filter

from lapwing.studies.flight_import.column_mapping import SCALES, Mapping, Motors, Scalar, Vector
from lapwing.studies.flight_import.csv_table import read_columns
from lapwing.studies.flight_import.recording import GYRO_LIMIT, LONGEST_GAP, Recording, widen
from lapwing.studies.flight_import.rotation_arrays import body_rate, from_ned_frd, unit
from lapwing.studies.flight_import.time_alignment import time_offset

FASTEST_TURN = 40.0  # [rad/s] between two measured attitudes above which tracking was lost
FASTEST = 20.0  # [m/s] between two measured positions, as above
ACCELEROMETER_LIMIT = 16.0 * 9.80665  # [m/s^2] range of the usual accelerometers
SPIKE = 8.0  # [rad/s] departure of a gyroscope from its running median that is a fault
FEWEST = 50  # samples of a recording
NEIGHBOURS = 2  # samples on either side of a fault that interpolation at recording may have touched


def read_csv_flight(path: Path, mapping: Mapping) -> Recording:
    """Read a CSV file as a recording.

    Raises:
        ValueError: the file cannot be read, a column is missing, time runs backwards, or a unit is wrong.
    """
    table = read_columns(path, mapping.columns)
    if missing := [name for name in mapping.motors.columns if name not in table]:
        raise ValueError(f"{path}: no motor outputs ({', '.join(missing)}); log the motor commands and fly again")
    if missing := [name for name in mapping.columns if name not in table]:
        raise ValueError(f"{path}: column {', '.join(missing)} is missing; check the --mapping")
    raw_time = table[mapping.time.column] * SCALES[mapping.time.unit]
    if len(raw_time) < FEWEST:
        raise ValueError(f"{path}: {len(raw_time)} rows; expected a flight of at least {FEWEST}")
    if not np.isfinite(raw_time).all():
        raise ValueError(f"{path}: column {mapping.time.column} is not finite in row {_first(~np.isfinite(raw_time))}")
    if (back := np.diff(raw_time) <= 0.0).any():
        raise ValueError(f"{path}: time runs backwards in row {_first(back) + 1}; sort the rows by time")
    time = raw_time - raw_time[0]
    faults: dict[str, int] = {}
    channels = {key: _vector(table, getattr(mapping, key)) for key in ("position", "velocity", "specific_force")}
    channels["omega"] = _vector(table, mapping.omega)
    channels["attitude"] = _attitude(table, mapping.attitude)
    invalid = {"gap in time": np.r_[False, np.diff(time) > LONGEST_GAP]}
    for key, values in channels.items():
        if values is not None:
            invalid[f"{key} not finite"] = ~np.isfinite(values).all(axis=1)
    duty, invalid["motor out of range"] = _motors(table, mapping.motors)
    battery, invalid["battery out of range"] = _battery(table, mapping.battery, time)
    if mapping.battery is None and mapping.motors.unit == "duty":
        raise ValueError(f"{path}: duty cycles without a battery voltage; map [battery], or motors in V")
    position, attitude, omega = channels["position"], channels["attitude"], channels["omega"]
    assert position is not None
    assert attitude is not None
    assert omega is not None
    step = np.diff(time, prepend=time[0] - (time[1] - time[0]))
    turning = body_rate(attitude, step)
    invalid["tracking lost"] = (np.abs(turning).max(axis=1) > FASTEST_TURN) | (
        np.abs(np.diff(position, axis=0, prepend=position[:1])).max(axis=1) > FASTEST * step
    )
    slow = median_filter(np.nan_to_num(omega), (5, 1), mode="nearest")
    invalid["gyroscope out of range"] = (np.abs(np.nan_to_num(omega)).max(axis=1) > GYRO_LIMIT) | (
        np.abs(np.nan_to_num(omega) - slow).max(axis=1) > SPIKE
    )
    if (force := channels["specific_force"]) is not None:
        invalid["accelerometer out of range"] = np.abs(np.nan_to_num(force)).max(axis=1) > ACCELEROMETER_LIMIT
    bad = np.zeros(len(time), bool)
    for cause, mask in invalid.items():
        if mask.any():
            faults[cause] = int(mask.sum())
            bad |= mask
    valid = ~widen(bad, NEIGHBOURS)
    _check_units(path, turning, omega, valid)
    interval = float(np.round(np.median(np.diff(time)), 5))
    voltage = duty * battery[:, None] if mapping.motors.unit == "duty" else duty
    velocity = channels["velocity"]
    if velocity is None:
        velocity = np.gradient(position, time, axis=0)
    lag, confidence = time_offset(turning, omega, valid, interval)
    notes = (f"vehicle clock {1e3 * lag:+.0f} ms against attitude, correlation {confidence:.2f}",)
    power = table[mapping.power.column] if mapping.power else np.full(len(time), np.nan)
    if force is None:
        force = np.full((len(time), 3), np.nan)
    name = path.name.removesuffix(".gz").removesuffix(".csv")
    plain: tuple[np.ndarray, ...] = position, attitude, velocity, omega, force, voltage, battery
    if np.abs(np.diff(time) - interval).max() > 0.1 * interval:
        grid = np.arange(0.0, time[-1] + 0.5 * interval, interval)
        plain, valid, power = _on_grid(grid, time, plain, valid, power)
    position, attitude, velocity, omega, force, voltage, battery = plain
    return Recording(
        name, interval, position, attitude, velocity, omega, force, voltage, battery, valid, power, faults, notes
    )


def _first(mask: np.ndarray) -> int:
    return int(np.flatnonzero(mask)[0]) + 1


def _vector(table: dict[str, np.ndarray], spec: Vector | None) -> np.ndarray | None:
    if spec is None:
        return None
    values = np.column_stack([table[name] for name in spec.columns]) * SCALES[spec.unit]
    if spec.sign:
        values = values * np.array(spec.sign)
    if spec.frame == "ned":
        return values[:, [1, 0, 2]] * [1.0, 1.0, -1.0]
    if spec.frame == "frd":
        return values * [1.0, -1.0, -1.0]
    return values


def _attitude(table: dict[str, np.ndarray], spec: Vector) -> np.ndarray:
    values = np.column_stack([table[name] for name in spec.columns])
    if len(spec.columns) == 4:
        quaternion = values if spec.unit == "wxyz" else values[:, [3, 0, 1, 2]]
    else:
        roll, pitch, yaw = (0.5 * values * SCALES[spec.unit]).T
        cr, sr, cp, sp, cy, sy = (f(a) for a in (roll, pitch, yaw) for f in (np.cos, np.sin))
        quaternion = np.column_stack(
            [
                cr * cp * cy + sr * sp * sy,
                sr * cp * cy - cr * sp * sy,
                cr * sp * cy + sr * cp * sy,
                cr * cp * sy - sr * sp * cy,
            ]
        )
    quaternion = unit(quaternion)
    return from_ned_frd(quaternion) if spec.frame == "ned_frd" else quaternion


def _motors(table: dict[str, np.ndarray], spec: Motors) -> tuple[np.ndarray, np.ndarray]:
    raw = np.column_stack([table[name] for name in spec.columns])
    values = (raw - spec.offset) / spec.full_scale
    if spec.unit == "V":
        return np.nan_to_num(values), ~np.asarray(np.isfinite(values).all(axis=1))
    inside = np.asarray((np.abs(values - 0.5) <= 0.502).all(axis=1))
    return np.clip(np.nan_to_num(values), 0.0, 1.0), ~inside


def _battery(table: dict[str, np.ndarray], spec: Scalar | None, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Voltage [V] with readings out of range bridged, and where they were."""
    if spec is None:
        return np.full(len(time), np.nan), np.zeros(len(time), bool)
    volts = table[spec.column] * SCALES[spec.unit]
    low, high = spec.range or (0.0, np.inf)
    outside = ~((volts >= low) & (volts <= high))
    if outside.all():
        return np.full(len(time), np.nan), outside
    volts = np.interp(time, time[~outside], volts[~outside])
    window = round(spec.smoothing / np.median(np.diff(time)))
    return (median_filter(volts, window | 1, mode="nearest") if window > 1 else volts), outside


def _check_units(path: Path, turning: np.ndarray, omega: np.ndarray, valid: np.ndarray) -> None:
    """Raise ValueError if the gyroscope is in degrees per second where the mapping says otherwise."""
    if valid.sum() < FEWEST:
        return
    measured, expected = np.nanstd(omega[valid]), np.nanstd(turning[valid])
    if expected > 0.05 and measured > 15.0 * expected:
        message = f"gyroscope is {measured / expected:.0f} times the rate of the attitude"
        raise ValueError(f"{path}: {message}, deg/s is suspected; set omega.unit in the mapping")


def _on_grid(
    grid: np.ndarray, time: np.ndarray, channels: tuple[np.ndarray, ...], valid: np.ndarray, power: np.ndarray
) -> tuple[tuple[np.ndarray, ...], np.ndarray, np.ndarray]:
    """Interpolate linearly onto a uniform grid; a sample is valid where both neighbours are, and near."""

    def moved(values: np.ndarray) -> np.ndarray:
        if values.ndim == 1:
            return np.interp(grid, time, values)
        return np.column_stack([np.interp(grid, time, column) for column in values.T])

    right = np.clip(np.searchsorted(time, grid), 1, len(time) - 1)
    sound = valid[right] & valid[right - 1] & (time[right] - time[right - 1] <= LONGEST_GAP)
    position, attitude, *rest = channels
    flips = np.cumprod(np.where(np.r_[1.0, np.sum(attitude[1:] * attitude[:-1], axis=1)] < 0.0, -1.0, 1.0))
    return (moved(position), unit(moved(attitude * flips[:, None])), *map(moved, rest)), sound, moved(power)
