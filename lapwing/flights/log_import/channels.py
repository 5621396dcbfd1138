"""Time series of a log with separate times for each quantity, and their conversion to a recording."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from lapwing.flights.log_import.log_conventions import in_enu_flu
from lapwing.flights.log_import.recording import SEA_LEVEL, Recording, Series
from lapwing.flights.log_import.source_checks import check_velocity, near, with_impossible_readings, with_jumps
from lapwing.flights.log_import.source_choice import LOWEST_VOLTAGE, Choices, choose, rows_of, runs
from lapwing.flights.log_import.time_alignment import describe
from lapwing.flights.rotation_arrays import body_rate, continuous, unit

RATE = 100.0  # [Hz] sampling rate of the recording
FASTER = 0.75  # period of the motor commands over that of the grid below which they are averaged
FEWEST = 50  # minimum number of samples of a recording
SPARSEST = 100  # largest ratio of samples of the grid to samples of the log
STEADY = 0.1  # largest deviation of a table's steps from their median, as a share, that needs no interpolation
DIP = 0.3  # [s] window of the running median that removes dips of the battery voltage
MOTION = ("attitude", "position", "velocity", "omega", "specific_force", "duty")
WIDTH = {"attitude": 4}  # number of values, 3 by default


@dataclass
class Channels:
    """Sources of the quantities of one vehicle's log in SI units.

    Quantities: attitude (quaternions w, x, y, z, body to world, or roll, pitch, yaw [rad]), position [m] and velocity
    [m/s] in the world, omega [rad/s] and specific_force [m/s^2] in the body, duty (throttle of each motor, 0 to 1),
    battery (voltage [V], and current [A] as a second column if measured), power [W], setpoint (columns of
    `Recording.setpoint`), attitude_setpoint (as attitude), and readings of sensors by the keys of `SENSORS` in
    `write_log`.

    Attributes:
        sources: sources of each quantity, the preferred first.
        dropouts: spans (begin, end) [s] in which the log lost messages, as it says itself.
        notes: remarks on the import, a line each.
        unknown: names of topics without a counterpart.
        in_volts: True if `duty` has voltages.
        firmware: firmware that numbers the motors, see `Recording`.
        battery_window: window of the running median of the voltage [s].
    """

    sources: dict[str, list[Series]] = field(default_factory=dict)
    dropouts: Sequence[tuple[float, float]] = ()
    notes: list[str] = field(default_factory=list)
    unknown: Sequence[str] = ()
    in_volts: bool = False
    firmware: str = ""
    battery_window: float = DIP

    def offer(self, quantity: str, candidates: Iterable[Series | None]) -> None:
        """Add sources of a quantity in the axes of their `frame`, used if those before carry no data; None: missing."""
        self.sources.setdefault(quantity, []).extend(
            with_impossible_readings(quantity, in_enu_flu(quantity, s))
            for s in candidates
            if s is not None and len(s.time)
        )


def to_recording(
    path: Path,
    channels: Channels,
    motors: str,
    rates: str,
    choices: Choices = Choices(),  # noqa: B008
    interval: float = 1.0 / RATE,
) -> Recording:
    """Sample all quantities, over the common time span of rates, motors, attitude and position.

    Args:
        path: path of the log, for messages.
        channels: quantities of the log.
        motors: names of messages with motor outputs, for messages.
        rates: names of messages with angular rates, for messages.
        choices: choices of the user.
        interval: time between two samples of the recording [s].

    Raises:
        ValueError: motor outputs or rates are missing, the flight is too short, or a choice does not fit the log.
    """
    order = (*MOTION, *(name for name in channels.sources if name not in MOTION))
    sources = {name: channels.sources[name] for name in order if channels.sources.get(name)}
    chosen, notes = choose(path, sources, choices)
    notes = [*channels.notes, *notes]
    for name, missing in (("duty", f"no motor outputs ({motors})"), ("omega", f"no rates ({rates})")):
        if name not in chosen or len(chosen[name].time) < 2:
            agrees = " that agree with the attitude" if sources.get(name) and name == "omega" else ""
            raise ValueError(f"{path}: {missing}{agrees}; log them and fly again")
    chosen = with_jumps(chosen)
    battery, unmeasured = _with_voltage(chosen.pop("battery", None))
    series = {name: chosen[name] for name in MOTION if name in chosen and chosen[name].believed.sum() > 1}
    common = [series[name] for name in ("attitude", "position", "omega", "duty") if name in series]
    begin, end = max(s.time[0] for s in common), min(s.time[-1] for s in common)
    if end - begin < (FEWEST - 1.01) * interval:
        raise ValueError(f"{path}: its messages overlap for {max(end - begin, 0.0):.1f} s; expected a flight")
    check_density(path, (end - begin) / interval, max(len(s.time) for s in common))
    grid = _grid(common, begin, end, interval)
    sampled, gaps, doubtful = {}, {}, {}
    for name, s in series.items():
        gaps[name], doubtful[name] = near(s, grid)
        good = s.kept()
        if name == "attitude":
            good = replace(good, values=continuous(unit(good.values)))
        # motors hold faster commands than the grid's; a sample of them would be half an interval late
        is_fast = name == "duty" and np.median(np.diff(good.time)) < FASTER * interval
        sampled[name] = good.means(grid, interval) if is_fast else good.at(grid)
    lost = np.zeros(len(grid), bool)
    for first, last in channels.dropouts:
        lost |= (grid >= first - interval) & (grid <= last + interval)
    gap = np.logical_or.reduce([*gaps.values(), lost])
    valid = ~np.logical_or.reduce([gap, *doubtful.values()])

    def values(name: str) -> np.ndarray:
        return sampled.get(name, np.full((len(grid), WIDTH.get(name, 3)), np.nan))

    position, omega, quaternion = values("position"), sampled["omega"], unit(values("attitude"))
    duty = sampled["duty"] if channels.in_volts else np.clip(sampled["duty"], 0.0, 1.0)
    velocity = sampled.get("velocity", np.gradient(position, interval, axis=0))
    volts, power = _battery(battery, grid, interval, channels.battery_window)
    if "power" in chosen:
        power = chosen.pop("power").at(grid)[:, 0]
    if has_shares := not np.isfinite(volts).all() and not channels.in_volts:
        notes.append("no battery voltage: motor voltages are shares of the full voltage")
    if "attitude" in series:
        attitude_rate = body_rate(quaternion, np.full(len(grid), interval))
        check_rate_unit(path, attitude_rate, omega, valid)
        notes.append(describe(attitude_rate, omega, valid, interval))
    if remark := check_velocity(series.get("position"), series.get("velocity")):
        notes.append(remark)
    if "gps" in chosen and chosen["gps"].datum == SEA_LEVEL:
        notes.append(
            "gps: the log has heights above mean sea level only; the fixes are marked, their datum is no ellipsoid"
        )
    if battery is not None:
        chosen["battery"] = battery
        if battery.doubts:  # readings out of the range of a mapping
            valid &= ~near(battery, grid)[1]
    faults = _faults(chosen, int(gap.sum()), unmeasured)
    desired = {name: chosen[name].latest(grid) for name in ("setpoint", "attitude_setpoint") if name in chosen}
    readings = {
        name: replace(s.kept(), time=s.kept().time - begin)
        for name, s in chosen.items()
        if name not in (*MOTION, "battery", "setpoint", "attitude_setpoint")
    }
    return Recording(
        path.stem, interval, position, quaternion, velocity, omega, values("specific_force"),
        duty if channels.in_volts else duty * np.where(np.isfinite(volts), volts, 1.0)[:, None], volts, valid, power,
        faults=faults, sources=tuple(rows_of(chosen, {name: int(mask.sum()) for name, mask in gaps.items()})),
        notes=tuple(notes), readings={name: s for name, s in readings.items() if len(s.time)},
        unknown=tuple(channels.unknown), has_shares=has_shares, firmware=channels.firmware, **desired,
    )  # fmt: skip


def _grid(common: Sequence[Series], begin: float, end: float, interval: float) -> np.ndarray:
    """Return the times of the samples [s]: those of the log, if all quantities have the same, nearly uniform ones."""
    time = common[0].time
    same = all(s.time is time or np.array_equal(s.time, time) for s in common)
    if same and np.abs(np.diff(time) - interval).max() <= STEADY * interval:
        drift = np.abs(time - time[0] - interval * np.arange(len(time))).max()
        if drift <= interval:
            return time
    return np.arange(begin, end + 1e-9 * interval, interval)


def _faults(chosen: dict[str, Series], gap: int, unmeasured: int) -> dict[str, int]:
    """Return the number of samples by cause; of resets and jumps the number of events."""
    faults = {"gap in a topic": gap, "battery not measured": unmeasured}
    motion = {name: chosen[name] for name in (*MOTION, "battery") if name in chosen}
    for name, s in motion.items():
        causes = {cause: int(mask.sum()) for cause, mask in s.doubts.items()}
        causes |= {cause: runs(mask) for cause, mask in s.resets.items()}
        doubted = np.logical_or.reduce([np.zeros(len(s.time), bool), *s.doubts.values()])
        causes["time not increasing"] = s.dropped
        causes[f"{name} not finite"] = int((~np.isfinite(s.values).all(axis=1) & ~doubted).sum()) * (name != "battery")
        for cause, count in causes.items():
            faults[cause] = faults.get(cause, 0) + count
    return {cause: count for cause, count in faults.items() if count}


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
    """Return the readings of a connected battery, None if there are none, and the number of the others."""
    if battery is None:
        return None, 0
    measured = ~(battery.values[:, 0] <= LOWEST_VOLTAGE)
    if measured.all():
        return battery, 0
    return battery.select(measured) if measured.any() else None, int((~measured).sum())


def _battery(battery: Series | None, grid: np.ndarray, interval: float, window: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the voltage [V] without short dips, and the power [W], shape (n,) each; NaN if not measured."""
    from scipy.ndimage import median_filter

    unmeasured = np.full(len(grid), np.nan)
    if battery is None or not (usable := np.isfinite(battery.values[:, 0]) & _undoubted(battery)).sum() > 1:
        return unmeasured, unmeasured
    values = battery.select(usable).at(grid)
    size = round(window / interval) | 1
    volts = median_filter(values[:, 0], size, mode="nearest") if size > 1 else values[:, 0]
    return volts, values[:, 0] * values[:, 1] if values.shape[1] > 1 else unmeasured


def _undoubted(series: Series) -> np.ndarray:
    return np.asarray(~np.logical_or.reduce([np.zeros(len(series.time), bool), *series.doubts.values()]))


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
