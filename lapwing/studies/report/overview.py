"""Overview of a flight: position over time, and the path in space."""

from lapwing.studies.flight_data import AXES, FlightData
from lapwing.studies.report.flight_phases import over
from lapwing.studies.report.plot import Line, Panel, Plot, reference
from lapwing.studies.report.plots.path import space


def overview(flight: FlightData) -> Plot:
    """Plot the position with its setpoint, and the path."""
    t, desired = flight.truth.times, flight.reference
    panels = []
    for row, name in enumerate(AXES[:3]):
        marks = (
            Line(t, flight.truth.position[:, row], "flown", width=2.0),
            reference(t[: len(desired)], desired[:, row]),
        )
        panels.append(Panel(marks, f"{name} [m]", row=row))
    panels.append(space(flight)._replace(column=1, rows=3))
    return Plot(tuple(panels), "", 4.6, (1.0,) * 3, (1.35, 1.0), **over(flight))
