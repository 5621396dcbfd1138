"""Path from two sides; the mission map shows it from above."""

from lapwing.flights.flight_data import FlightData
from lapwing.views.report.flight_phases import check_measured
from lapwing.views.report.plot import Line, Panel, Plot, reference

ORDER = 40
TITLE = "Path from the side"
NEEDS = ("ground_truth",)


def draw(flight: FlightData) -> Plot:
    """Plot the views from the south and from the east."""
    check_measured("the position", flight.truth.position)
    reference_text = " and its reference" if len(flight.reference) else ""
    caption = f"Path{reference_text} from the south (left) and from the east (right)."
    return Plot(tuple(side(flight, axis)._replace(column=axis) for axis in (0, 1)), caption, 3.6, (1.0,), (1.0, 1.0))


def space(flight: FlightData) -> Panel:
    """Return the panel of the path in space, with equal scales of the three axes."""
    x, y, z = flight.truth.position.T
    marks = [Line(x, y, "flown", width=2.0, z=z)]
    if len(flight.reference):
        east, north, up = flight.reference.T[:3]
        marks.append(reference(east, north)._replace(z=up))
    return Panel(tuple(marks), "y north [m]", "x east [m]", z_label="z up [m]", timed=False)


def side(flight: FlightData, axis: int) -> Panel:
    """Return the panel of the height over x east (axis 0) or y north (axis 1)."""
    marks = [Line(flight.truth.position[:, axis], flight.truth.position[:, 2], "flown", width=2.0)]
    if len(flight.reference):
        marks.append(reference(flight.reference[:, axis], flight.reference[:, 2]))
    return Panel(tuple(marks), "z up [m]", ("x east [m]", "y north [m]")[axis], timed=False)
