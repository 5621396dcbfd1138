"""Recording from the columns of a CSV file and their mapping."""

from pathlib import Path

import numpy as np
from scipy.ndimage import median_filter

from lapwing.dynamics.constants import STANDARD_GRAVITY
from lapwing.studies.flight_import.channels import check_density, check_rate_unit
from lapwing.studies.flight_import.column_mapping import SCALES, Mapping, Motors, Scalar, Vector
from lapwing.studies.flight_import.csv_table import read_columns
from lapwing.studies.flight_import.recording import GYRO_LIMIT, LONGEST_GAP, SETPOINT_WIDTH, Recording, widen
from lapwing.studies.flight_import.time_alignment import describe
from lapwing.studies.rotation_arrays import body_rate, continuous, from_euler, from_ned_frd, ned_to_enu, unit

FASTEST_TURN = 40.0  # [rad/s] mean rate between two measured attitudes above which tracking is lost
FASTEST = 20.0  # [m/s] mean speed between two measured positions above which tracking is lost
ACCELEROMETER_LIMIT = 16.0 * STANDARD_GRAVITY  # [m/s^2] range of common accelerometers
SPIKE = 8.0  # [rad/s] difference of a gyroscope from its running median above which it is a fault
FEWEST = 50  # minimum number of samples of a recording
NEIGHBOURS = 2  # samples on either side of a fault that interpolation may have changed


def read_csv_flight(path: Path, mapping: Mapping) -> Recording:
    """Read a CSV file as a recording.

    Raises:
        ValueError: the file cannot be read, a column is missing, time runs backwards, or a unit is wrong.
    """
    return from_columns(path, read_columns(path, mapping.columns), mapping)


def from_columns(path: Path, table: dict[str, np.ndarray], mapping: Mapping) -> Recording:
    """Return the recording from columns with a common time.

    Args:
        path: path of the file, for messages and the flight's name.
        table: columns by name, each of shape (n,).
        mapping: mapping of the columns.

    Raises:
        ValueError: a column is missing, time runs backwards, or a unit is wrong.
    """
    mapping = mapping.within(table)
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
    step = np.diff(time, prepend=time[0] - (time[1] - time[0]))
    channels = {
        key: _vector(table, getattr(mapping, key)) for key in ("position", "velocity", "specific_force", "omega")
    }
    channels["attitude"] = _attitude(table, mapping.attitude)
    measured = {key: values for key, values in channels.items() if values is not None}
    unmeasured = np.full((len(time), 3), np.nan)
    position, omega, force = (measured.get(key, unmeasured) for key in ("position", "omega", "specific_force"))
    attitude = measured.get("attitude", np.full((len(time), 4), np.nan))
    attitude_rate = body_rate(attitude, step)
    duty, outside = _motors(table, mapping.motors)
    battery, dips = _battery(table, mapping.battery, time)
    slow = median_filter(np.nan_to_num(omega), (5, 1), mode="nearest")
    invalid = {
        "gap in time": np.r_[False, np.diff(time) > LONGEST_GAP],
        **{f"{key} not finite": ~np.isfinite(values).all(axis=1) for key, values in measured.items()},
        "motor out of range": outside,
        "battery out of range": dips,
        "tracking lost": (np.abs(np.nan_to_num(attitude_rate)).max(axis=1) > FASTEST_TURN)
        | (np.abs(np.nan_to_num(np.diff(position, axis=0, prepend=position[:1]))).max(axis=1) > FASTEST * step),
        "gyroscope out of range": (np.abs(np.nan_to_num(omega)).max(axis=1) > GYRO_LIMIT)
        | (np.abs(np.nan_to_num(omega) - slow).max(axis=1) > SPIKE),
        "accelerometer out of range": np.abs(np.nan_to_num(force)).max(axis=1) > ACCELEROMETER_LIMIT,
    }
    faults = {cause: int(mask.sum()) for cause, mask in invalid.items() if mask.any()}
    valid = ~widen(np.logical_or.reduce(list(invalid.values())), NEIGHBOURS)
    interval = float(np.round(np.median(np.diff(time)), 5))
    notes = []
    if "attitude" in measured:
        check_rate_unit(path, attitude_rate, omega, valid)
        notes.append(describe(attitude_rate, omega, valid, interval))
    if duty.min() >= mapping.motors.unused_below > 0.0:
        notes.append(f"motors never below {duty.min():.0%}: other units are suspected; see motorOutput in the header")
    voltage = duty
    if mapping.motors.unit == "duty":
        if np.isfinite(battery).all():
            voltage = duty * battery[:, None]
        else:
            notes.append("no battery voltage: motor voltages are shares of the full voltage")
    velocity = measured.get("velocity", np.gradient(position, time, axis=0))
    power = table[mapping.power.column] if mapping.power else np.full(len(time), np.nan)
    name = path.name.removesuffix(".gz").removesuffix(".csv")
    desired = _vector(table, mapping.setpoint)
    setpoint = np.empty((0, SETPOINT_WIDTH))
    if desired is not None:
        setpoint = np.full((len(time), SETPOINT_WIDTH), np.nan)
        setpoint[:, :3] = desired
    plain: tuple[np.ndarray, ...] = position, attitude, velocity, omega, force, voltage, battery
    clock_error = np.abs(time - interval * np.arange(len(time))).max()
    if clock_error > interval or np.abs(np.diff(time) - interval).max() > 0.1 * interval:
        check_density(path, time[-1] / interval if interval > 0.0 else np.inf, len(time))
        grid = np.arange(0.0, time[-1] + 0.5 * interval, interval)
        plain, valid, power = _on_grid(grid, time, plain, valid, power)
        if len(setpoint):
            setpoint = np.column_stack([np.interp(grid, time, column) for column in setpoint.T])
    position, attitude, velocity, omega, force, voltage, battery = plain
    return Recording(
        name, interval, position, attitude, velocity, omega, force, voltage, battery, valid, power, setpoint,
        faults=faults, notes=tuple(notes),
    )  # fmt: skip


def _first(mask: np.ndarray) -> int:
    return int(np.flatnonzero(mask)[0]) + 1


def _vector(table: dict[str, np.ndarray], spec: Vector | None) -> np.ndarray | None:
    if spec is None:
        return None
    values = np.column_stack([table[name] for name in spec.columns]) * (spec.scale * SCALES[spec.unit])
    if spec.sign:
        values = values * np.array(spec.sign)
    if spec.frame == "ned":
        return ned_to_enu(values)
    if spec.frame == "frd":
        return values * [1.0, -1.0, -1.0]
    return values


def _attitude(table: dict[str, np.ndarray], spec: Vector | None) -> np.ndarray | None:
    if spec is None:
        return None
    values = np.column_stack([table[name] for name in spec.columns])
    if len(spec.columns) == 4:
        quaternion = values if spec.unit == "wxyz" else values[:, [3, 0, 1, 2]]
    else:
        quaternion = from_euler(values * spec.scale * SCALES[spec.unit])
    return from_ned_frd(unit(quaternion)) if spec.frame == "ned_frd" else unit(quaternion)


def _motors(table: dict[str, np.ndarray], spec: Motors) -> tuple[np.ndarray, np.ndarray]:
    raw = np.column_stack([table[name] for name in spec.columns])
    values = (raw - spec.offset) / spec.full_scale
    if spec.unit == "V":
        return np.nan_to_num(values), ~np.asarray(np.isfinite(values).all(axis=1))
    inside = np.asarray((np.abs(values - 0.5) <= 0.502).all(axis=1))
    return np.clip(np.nan_to_num(values), 0.0, 1.0), ~inside


def _battery(table: dict[str, np.ndarray], spec: Scalar | None, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the voltage [V] with invalid readings interpolated, and the mask of invalid readings, shape (n,) each."""
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


def _on_grid(
    grid: np.ndarray, time: np.ndarray, channels: tuple[np.ndarray, ...], valid: np.ndarray, power: np.ndarray
) -> tuple[tuple[np.ndarray, ...], np.ndarray, np.ndarray]:
    """Interpolate linearly onto a uniform grid; a sample is valid if both neighbours are valid and close in time."""

    def transform(values: np.ndarray) -> np.ndarray:
        if values.ndim == 1:
            return np.interp(grid, time, values)
        return np.column_stack([np.interp(grid, time, column) for column in values.T])

    right = np.clip(np.searchsorted(time, grid), 1, len(time) - 1)
    is_valid = valid[right] & valid[right - 1] & (time[right] - time[right - 1] <= LONGEST_GAP)
    position, attitude, *rest = channels
    return (
        (transform(position), unit(transform(continuous(attitude))), *map(transform, rest)),
        is_valid,
        transform(power),
    )
