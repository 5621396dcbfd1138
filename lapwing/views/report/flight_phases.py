"""Time span, phases and setpoint of a flight, shared by all report plots."""

from collections.abc import Iterator

import numpy as np

from lapwing.flights.flight_data import FlightData
from lapwing.flights.flight_topics import AXES
from lapwing.flights.tracking import digits
from lapwing.views.report.plot import Level, Line, NotRecordedError, Panel, Plot, reference

DEGREES = 180.0 / np.pi  # [deg] in 1 rad


def over(flight: FlightData) -> dict:
    """Return time span and phases of a flight, as arguments of a `Plot`."""
    t = flight.truth.times
    return {"span": (float(t[0]), float(max(t[-1], t[0] + 1e-9))), "phases": tuple(phases(flight))}


def check_measured(name: str, values: np.ndarray) -> None:
    """Raise NotRecordedError for a quantity that is constant, or not finite anywhere; shape (n, k)."""
    if not np.isfinite(values).any():
        raise NotRecordedError(f"{name} is not measured")
    if len(values) > 1 and not np.ptp(values, axis=0).any():
        raise NotRecordedError(f"{name} is constant")


def phases(flight: FlightData) -> list[tuple[str, float, float]]:
    """Return the name, start and end [s] of each phase of the mission, in order; empty without setpoints."""
    if not flight.has("setpoint"):
        return []
    return [run for run in runs(flight.setpoint.times, flight.setpoint.phase) if run[0]]


def runs(t: np.ndarray, values: np.ndarray) -> list[tuple[str, float, float]]:
    """Return the value as text, start and end [s] of each interval of constant value; t and values have shape (n,)."""
    starts = [0, *(np.flatnonzero(values[1:] != values[:-1]) + 1)]
    ends = [*t[starts[1:]], t[-1]]
    return [(str(values[k]), float(t[k]), float(end)) for k, end in zip(starts, ends, strict=True)]


def _stretches(armed: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield the rows of each uninterrupted stretch with armed motors, and their numbers among all armed rows."""
    rows = np.flatnonzero(armed)
    for part in np.split(np.arange(len(rows)), np.flatnonzero(np.diff(rows) > 1) + 1):
        yield rows[part], part


def three_axes(flight: FlightData, first: int, actual: np.ndarray, unit: str, scale: float, caption: str) -> Plot:
    """Plot three axes over time, one per row, with the tracking error if there is a setpoint.

    Args:
        flight: flight of the vehicle.
        first: 0 for the position, 3 for the angles.
        actual: values in `unit`, shape (n, 3).
        unit: unit of the plots.
        scale: 1 m or 1 rad in `unit`.
        caption: caption of the plot.

    Raises:
        NotRecordedError: the values are constant or not measured.
    """
    check_measured("it", actual)
    t, n, panels = flight.truth.times, len(flight.reference), []
    has_errors = bool(flight.armed.any())
    for row, name in enumerate(AXES[first : first + 3]):
        marks = [Line(t, actual[:, row], "flown", width=1.5)]
        if n:
            marks.append(reference(t[:n], scale * flight.reference[:, first + row], hidden=has_errors))
        panels.append(Panel(tuple(marks), f"{name} [{unit}]", row=row))
        if has_errors:
            rmse = scale * flight.rmse[name]
            values = scale * flight.errors[name]
            errors = [Line(t[rows], values[part], width=1.0) for rows, part in _stretches(flight.armed)]
            bounds = Level(rmse, "± RMSE"), Level(-rmse, "± RMSE")
            title = f"RMSE {digits(rmse)} {unit}"
            panels.append(Panel((*errors, *bounds), f"{name} error [{unit}]", title=title, row=row, column=1))
    if has_errors:
        caption += " On the right: reference minus truth while the motors are armed."
    widths = (1.0, 1.0) if has_errors else (1.0,)
    return Plot(tuple(panels), caption, 6.6, (1.0,) * 3, widths, **over(flight))
