"""Speed, voltage and power of the motors over time (the paper's Figures 24 to 26)."""

import numpy as np

from lapwing.flights.battery_use import WATT_HOUR
from lapwing.flights.flight_data import FlightData
from lapwing.flights.saturation import highest_voltage, percent, saturation
from lapwing.views.report.flight_phases import over
from lapwing.views.report.plot import Level, Line, NotRecordedError, Panel, Plot, column
from lapwing.views.report.style import BOUND, COLOURS, STEERED

ORDER = 50
TITLE = "Motors: speed, voltage and power"
NEEDS = ("ground_truth",)
MODELS = STEERED
RPM = 60.0 / (2.0 * np.pi)  # [rpm] in 1 rad/s


def draw(flight: FlightData) -> Plot:
    """Plot each quantity in a panel, with a line for each motor."""
    truth, t = flight.truth, flight.truth.times
    if truth.motor_voltage.shape[-1] == 0:
        raise NotRecordedError("the vehicle has no motors")
    marks, note = limits(flight)
    if truth.rotor_speed.shape[-1] == 0:  # an imported flight
        label = "voltage [V]" if flight.has("battery") else "throttle [1]"
        panel = Panel(motors(t, truth.motor_voltage), label)
        return Plot(caption="Commands of the motors. " + note, **column([panel], 3.0, **over(flight)))
    quantities = (
        ("propeller speed [rpm]", truth.rotor_speed * RPM),
        ("voltage [V]", truth.motor_voltage),
        ("electrical power [W]", truth.motor_power),
    )
    panels = [Panel(motors(t, values), label) for label, values in quantities]
    panels[1] = panels[1]._replace(marks=panels[1].marks + marks)
    energy = float(np.sum(np.diff(t) * truth.motor_power.sum(axis=1)[:-1])) / WATT_HOUR
    caption = f"Speed of each propeller, voltage and power of its motor. All motors consume {energy:.1f} W h. "
    return Plot(caption=caption + note, **column(panels, 2.2, **over(flight)))


def motors(t: np.ndarray, values: np.ndarray) -> tuple[Line, ...]:
    """Return a line for each column of values, shape (n, motors)."""
    return tuple(Line(t, column, f"motor {k + 1}", COLOURS[k % len(COLOURS)], 1.0) for k, column in enumerate(values.T))


def limits(flight: FlightData) -> tuple[tuple[Level | Line, ...], str]:
    """Return the voltage limits, the intervals at a limit, and a sentence on them."""
    highest = highest_voltage(flight.origin.scene)
    if highest is None:
        return (), "The log has no voltage limit."
    levels = Level(0.0, "limits", BOUND, "dot"), Level(highest, "limits", BOUND, "dot")
    if not len(flight.armed):
        return levels, f"Limits of the voltage: 0 and {highest:g} V."
    t, saturated = flight.truth.times[: len(flight.armed)], saturation(flight.truth, flight.armed, highest)
    if not saturated.lasted:
        return levels, f"No motor reaches a voltage limit (0 or {highest:g} V) in the air."
    marks = (*_limit_lines(t, saturated.low, 0.0), *_limit_lines(t, saturated.high, highest))
    return (*levels, *marks), (
        f"Marked: a motor is at a voltage limit (0 or {highest:g} V) in the air, in total for "
        f"{saturated.lasted:.2f} s, {percent(saturated.share(saturated.lasted))} of that time."
    )


def _limit_lines(t: np.ndarray, at_limit: np.ndarray, limit: float) -> tuple[Line, ...]:
    """Return a line along the limit with a segment for each interval with a motor there; empty without one."""
    any_motor = np.concatenate([[False], at_limit.any(axis=1), [False]])
    edges = np.flatnonzero(any_motor[1:] != any_motor[:-1])
    if not len(edges):
        return ()
    starts, ends = t[edges[::2]], t[(edges[1::2]).clip(max=len(t) - 1)]
    x = np.column_stack([starts, ends, np.full(len(starts), np.nan)]).ravel()
    return (Line(x, np.where(np.isnan(x), np.nan, limit), "at a limit", BOUND, 4.0, marker="square", size=6.0),)
