"""Recording from the columns of a CSV file and their mapping."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from lapwing.flights.log_import.channels import FEWEST, Channels, check_density, to_recording
from lapwing.flights.log_import.column_mapping import SCALES, Mapping, Motors, Vector
from lapwing.flights.log_import.csv_table import read_columns
from lapwing.flights.log_import.recording import SETPOINT_WIDTH, Recording, Series
from lapwing.flights.log_import.source_choice import Choices
from lapwing.flights.rotation_arrays import from_xyzw

MOST_EQUAL = 0.9  # largest share of rows with the time of the row before
GAP = 1.75  # times the median step, from which samples are missing


def read_csv_flight(path: Path, mapping: Mapping, choices: Choices = Choices()) -> Recording:  # noqa: B008
    """Read a CSV file as a recording.

    Raises:
        ValueError: the file cannot be read, a column is missing, time runs backwards, or a unit is wrong.
    """
    return from_columns(path, read_columns(path, mapping.columns), mapping, choices)


def from_columns(
    path: Path,
    table: dict[str, np.ndarray],
    mapping: Mapping,
    choices: Choices = Choices(),  # noqa: B008
) -> Recording:
    """Return the recording from columns with a common time.

    Args:
        path: path of the file, for messages and the flight's name.
        table: columns by name, each of shape (n,).
        mapping: mapping of the columns.
        choices: choices of the user.

    Raises:
        ValueError: a column is missing, time runs backwards, or a unit is wrong.
    """
    mapping = mapping.within(table)
    if missing := [name for name in mapping.motors.columns if name not in table]:
        raise ValueError(f"{path}: no motor outputs ({', '.join(missing)}); log the motor commands and fly again")
    if missing := [name for name in mapping.columns if name not in table]:
        raise ValueError(f"{path}: column {', '.join(missing)} is missing; check the --mapping")
    time = _time(path, table[mapping.time.column] * SCALES[mapping.time.unit])
    channels = Channels(in_volts=mapping.motors.unit == "V")

    def offer(name: str, values: np.ndarray, columns: tuple[str, ...], frame: str = "", doubts: Any = ()) -> None:
        axes, source = frame.upper().replace("_", " "), " ... ".join(dict.fromkeys((columns[0], columns[-1])))
        channels.offer(name, [Series.of(time, values, doubts, source=source, frame=axes)])

    for name in ("attitude", "position", "velocity", "specific_force", "omega"):
        if (spec := getattr(mapping, name)) is not None:
            offer(name, _vector(table, spec), spec.columns, spec.frame)
    duty, outside = _motors(table, mapping.motors)
    offer("duty", duty, mapping.motors.columns, "", [("motor out of range", outside)])
    if duty.min() >= mapping.motors.unused_below > 0.0:
        channels.notes.append(
            f"motors never below {100.0 * duty.min():.0f} %: other units are suspected; see motorOutput in the header"
        )
    if (battery := mapping.battery) is not None:
        volts = table[battery.column] * SCALES[battery.unit]
        channels.battery_window = battery.smoothing
        low, high = battery.range or (0.0, np.inf)
        offer("battery", volts, (battery.column,), "", [("battery out of range", ~((volts >= low) & (volts <= high)))])
    if mapping.power is not None:
        offer("power", table[mapping.power.column], (mapping.power.column,))
    if mapping.setpoint is not None:
        setpoint = np.full((len(time), SETPOINT_WIDTH), np.nan)
        setpoint[:, :3] = _vector(table, mapping.setpoint)
        offer("setpoint", setpoint, mapping.setpoint.columns, mapping.setpoint.frame)
    kept = time[np.r_[True, np.diff(time) > 0.0]]
    interval = _interval(kept)
    check_density(path, kept[-1] / interval, len(kept))
    flight = to_recording(path, channels, ", ".join(mapping.motors.columns), "omega", choices, interval)
    return replace(flight, name=path.name.removesuffix(".gz").removesuffix(".csv"))


def _time(path: Path, time: np.ndarray) -> np.ndarray:
    """Return the time from the first row [s]. Raise ValueError if it is no time of a flight."""
    if len(time) < FEWEST:
        raise ValueError(f"{path}: {len(time)} rows; expected a flight of at least {FEWEST}")
    if not np.isfinite(time).all():
        raise ValueError(f"{path}: the time is not a finite number in row {_first(~np.isfinite(time))}; delete the row")
    if (back := np.diff(time) < 0.0).any():
        raise ValueError(f"{path}: time runs backwards in row {_first(back) + 1}; sort the rows by time")
    if (equal := np.diff(time) == 0.0).all():
        raise ValueError(f"{path}: all rows have the same time; check time.column in the mapping")
    if equal.mean() > MOST_EQUAL:
        raise ValueError(
            f"{path}: {100.0 * equal.mean():.0f} % of the rows have the time of the row before; "
            "its resolution is too low, check time.column in the mapping, or log a finer time"
        )
    return np.asarray(time - time[0])


def _interval(time: np.ndarray) -> float:
    """Return the mean time between two samples [s] without gaps: a second has a whole number, as of a plant's ticks."""
    steps = np.diff(time)
    return 1.0 / max(1, round(1.0 / float(steps[steps < GAP * np.median(steps)].mean())))


def _first(mask: np.ndarray) -> int:
    return int(np.flatnonzero(mask)[0]) + 1


def _vector(table: dict[str, np.ndarray], spec: Vector) -> np.ndarray:
    """Return the values in SI units, quaternions as w, x, y, z."""
    values = np.column_stack([table[name] for name in spec.columns]) * (spec.scale * SCALES.get(spec.unit, 1.0))
    if spec.sign:
        values = values * np.array(spec.sign)
    return from_xyzw(values) if spec.unit == "xyzw" else values


def _motors(table: dict[str, np.ndarray], spec: Motors) -> tuple[np.ndarray, np.ndarray]:
    raw = np.column_stack([table[name] for name in spec.columns])
    values = (raw - spec.offset) / spec.full_scale
    if spec.unit == "V":
        return np.nan_to_num(values), ~np.asarray(np.isfinite(values).all(axis=1))
    inside = np.asarray((np.abs(values - 0.5) <= 0.502).all(axis=1))
    return np.clip(np.nan_to_num(values), 0.0, 1.0), ~inside
