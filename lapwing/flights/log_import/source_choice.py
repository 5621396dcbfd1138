"""Choice of the source and the instance of each quantity of a log, and the table that an import ends with."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lapwing.flights.log_import.recording import Series, SourceRow
from lapwing.flights.log_import.time_alignment import CLEAR, TURNING, time_offset
from lapwing.flights.rotation_arrays import body_rate, continuous, unit

INERTIAL = ("omega", "specific_force", "imu")  # quantities of one device, which turns as the vehicle does
PARTIAL = ("duty", "battery", "setpoint", "attitude_setpoint")  # may lack some values
RATE = 100.0  # [Hz] of the comparison of a gyroscope with the attitude
LOWEST_VOLTAGE = 1.0  # [V] of a connected battery, as offsets of idle inputs are lower
MOVING = 0.02  # share of the samples at which motors in use change
BETTER = 0.1  # difference of two correlations that matters
CAMERA = ("camera", "optical", "realsense", "d435", "d455", "t265", "zed", "oak")  # parts of the names of cameras


class Choices(NamedTuple):
    """Choices of the user.

    Attributes:
        instances: instance by the name of a quantity or of the log's messages.
        twist_frame: axes of the velocity of an odometry ("body", "world", or "none" to leave it out), "" for those of
            the message's definition.
    """

    instances: Mapping[str, int] = {}
    twist_frame: str = ""


def choices_of(instances: Sequence[str], twist_frame: str) -> Choices:
    """Return the choices of a command line.

    Args:
        instances: texts NAME=N.
        twist_frame: "body", "world", "none" or "".

    Raises:
        ValueError: a text has another form.
    """
    numbers = {}
    for text in instances:
        name, _, number = text.partition("=")
        if not name or not number.isdecimal():
            raise ValueError(f"--instance {text}: expected NAME=N, such as battery=1")
        numbers[name] = int(number)
    if twist_frame not in ("", "body", "world", "none"):
        raise ValueError(f"--twist-frame {twist_frame}: unknown axes; use body, world or none")
    return Choices(numbers, twist_frame)


def choose(
    path: Path, sources: Mapping[str, Sequence[Series]], choices: Choices
) -> tuple[dict[str, Series], list[str]]:
    """Return the source of each quantity, and notes on choices between several.

    The first instance that carries data is used. Among several gyroscopes, the one that turns as the attitude does is
    used, and the accelerometer of the same device.

    Raises:
        ValueError: `choices` names an unknown quantity, or an instance that the log does not have.
    """
    _check_names(path, sources, choices)
    chosen: dict[str, Series] = {}
    notes: list[str] = []
    several: dict[str, list[str]] = {}  # names of the signals by choice of an instance
    for name, candidates in sources.items():
        wanted = [s for s in candidates if _wanted(name, s, choices) in (None, s.instance)]
        measured = [s for s in wanted if len(_measured(name, s)) > 1]
        usable = [s for s in measured if _carries_data(name, s) or _wanted(name, s, choices) is not None] or measured
        if name in INERTIAL and "omega" in chosen and name != "omega":
            device = chosen["omega"].source, chosen["omega"].instance
            usable.sort(key=lambda s: (s.source, s.instance) != device)
        elif name == "omega":
            usable = _turning_with(chosen.get("attitude"), usable, notes)
        if name == "rangefinder":
            usable = _downward(chosen.get("position"), usable)
        if usable:
            chosen[name] = usable[0]
            same = {s.instance: s for s in candidates if s.source == usable[0].source}
            if len(same) > 1 and usable[0].instance is not None:
                idle = [str(number) for number, s in same.items() if not _carries_data(name, s)]
                why = f"; {', '.join(idle)} without data" if idle else ""
                numbers = ", ".join(map(str, same))
                text = f"instance {usable[0].instance} of {usable[0].source} ({numbers}){why}"
                several.setdefault(text, []).append(name)
        elif wanted and not measured:
            doubts = ", ".join(f"{cause}: {mask.sum()}" for cause, mask in wanted[0].doubts.items() if mask.any())
            notes.append(
                f"{name}: no sample of {_direction(wanted[0])} is to be believed; {doubts or 'none is finite'}"
            )
        elif wanted and name == "rangefinder":
            notes.append(f"rangefinder: {_direction(wanted[0])} looks {wanted[0].frame}, not down: not used")
    return chosen, [*notes, *(f"{', '.join(names)}: {text}" for text, names in several.items())]


def _direction(series: Series) -> str:
    return series.source if series.instance is None else f"{series.source} {series.instance}"


def _wanted(name: str, series: Series, choices: Choices) -> int | None:
    return choices.instances.get(name, choices.instances.get(series.source))


def _check_names(path: Path, sources: Mapping[str, Sequence[Series]], choices: Choices) -> None:
    for key, number in choices.instances.items():
        fitting = [s for name, all_of in sources.items() for s in all_of if key in (name, s.source)]
        if not fitting:
            numbered = sorted({name for name, all_of in sources.items() if any(s.instance is not None for s in all_of)})
            names = ", ".join(numbered) or "none"
            raise ValueError(f"--instance {key}={number}: {path} has no {key}; use one of {names}")
        if number not in (known := sorted({s.instance for s in fitting if s.instance is not None})):
            numbers = ", ".join(map(str, known)) or "a single one without a number"
            raise ValueError(f"--instance {key}={number}: {path} has no such instance; use one of {numbers}")


def _measured(name: str, series: Series) -> np.ndarray:
    """Return the values of the believed samples, of a quantity in `PARTIAL` those with any value."""
    if name not in PARTIAL:
        return series.values[series.believed]
    return series.values[np.isfinite(series.values).any(axis=1)]


def _carries_data(name: str, series: Series) -> bool:
    """Return True for a source that is in use: motors that change, a battery with a voltage, readings other than 0."""
    values = np.nan_to_num(_measured(name, series))
    if len(values) < 2:
        return False
    if name == "duty":  # outputs that only change when the vehicle is armed drive no motors
        return bool(np.diff(values, axis=0).any(axis=1).mean() > MOVING)
    return bool((values[:, 0] > LOWEST_VOLTAGE).any() if name == "battery" else values.any())


def _downward(position: Series | None, sensors: list[Series]) -> list[Series]:
    """Return the range sensors that look down; of several first the one that is believed most.

    Of several without a direction, the first is the one that follows the height.
    """
    fitting = [s for s in sensors if s.frame == "down"] or [s for s in sensors if not s.frame]
    fitting.sort(key=lambda s: -float(s.believed.mean()))
    if position is not None and len(fitting) > 1 and not fitting[0].frame:
        height = position.kept()
        fitting.sort(key=lambda s: float(np.std(s.kept().values[:, 0] - height.at(s.kept().time)[:, 2])))
    return fitting


def _turning_with(attitude: Series | None, gyroscopes: list[Series], notes: list[str]) -> list[Series]:
    """Return the gyroscopes, first the one that turns as the attitude does; those of cameras only if they do."""
    named = [s for s in gyroscopes if any(part in f"{s.source} {s.frame}".lower() for part in CAMERA)]
    if attitude is None or (len(gyroscopes) < 2 and not named):
        return gyroscopes
    scores = [_correlation(attitude, s) for s in gyroscopes]
    if any(score is None for score in scores):  # the vehicle does not turn
        return [*(s for s in gyroscopes if s not in named), *named]
    best = max(score for score in scores if score is not None)
    if best < CLEAR:
        return [s for s in gyroscopes if not any(s is camera for camera in named)]
    fitting = [s for s, score in zip(gyroscopes, scores, strict=True) if score is not None and score > best - BETTER]
    for s, score in zip(gyroscopes, scores, strict=True):
        if not any(s is other for other in fitting):
            notes.append(
                f"omega: {_direction(s)} turns differently from the attitude, correlation {score:.2f}: not used"
            )
    return fitting


def _correlation(attitude: Series, omega: Series) -> float | None:
    """Return the correlation of a gyroscope with the rate of the attitude, None if they do not turn or overlap."""
    attitude, omega = attitude.kept(), omega.kept()
    if len(attitude.time) < 2 or len(omega.time) < 2:
        return None
    grid = np.arange(max(attitude.time[0], omega.time[0]), min(attitude.time[-1], omega.time[-1]), 1.0 / RATE)
    if len(grid) < RATE:
        return None
    attitude = Series(attitude.time, continuous(unit(attitude.values)))
    turning = body_rate(unit(attitude.at(grid)), np.full(len(grid), 1.0 / RATE))
    if np.nanstd(turning) < TURNING:
        return None
    score = time_offset(turning, omega.at(grid), np.isfinite(turning).all(axis=1), 1.0 / RATE)[1]
    ratio = float(np.std(omega.at(grid)) / max(np.nanstd(turning), 1e-9))
    return score if ratio < 15.0 else CLEAR  # degrees instead of radians have an error of their own


def rows_of(chosen: Mapping[str, Series], gaps: Mapping[str, int]) -> list[SourceRow]:
    """Return the table of an import: the source of each quantity, and what is left out of it."""
    rows = []
    for name, s in chosen.items():
        causes = {
            "time not increasing": s.dropped,
            **{cause: int(mask.sum()) for cause, mask in s.doubts.items()},
            **{cause: runs(mask) for cause, mask in s.resets.items()},
            "gap": gaps.get(name, 0),
        }
        doubted = np.logical_or.reduce([np.zeros(len(s.time), bool), *s.doubts.values()])
        if name not in PARTIAL:
            causes["not finite"] = int((~np.isfinite(s.values).all(axis=1) & ~doubted).sum())
        left_out = ", ".join(f"{cause} {count}" for cause, count in causes.items() if count)
        instance = "" if s.instance is None else str(s.instance)
        rows.append(SourceRow(name, s.source, instance, s.datum, s.frame, len(s.time) + s.dropped, left_out or "-"))
    return rows


def runs(mask: np.ndarray) -> int:
    """Return the number of runs of True."""
    return int((np.diff(mask.astype(int), prepend=0) > 0).sum())
