"""Paths of all vehicles of a fleet from above, and their minimum separation."""

from lapwing.flights.flight_data import FlightData
from lapwing.flights.separation import least_over_time, nearest
from lapwing.views.report.plot import Level, Line, NotRecordedError, Panel, Plot
from lapwing.views.report.style import COLOURS

ORDER = 42
TITLE = "Fleet"
NEEDS = ("ground_truth",)
FLEET = True


def draw(flight: FlightData) -> Plot:
    """Plot the plan view on the left, the minimum separation over time on the right."""
    if len(flight.fleet) < 2:
        raise NotRecordedError("a single vehicle")
    marks = []
    for i, (name, truth) in enumerate(flight.fleet.items()):
        x, y, _ = truth.position.T
        colour = COLOURS[i % len(COLOURS)]
        marks.append(Line(x, y, name, colour))
        marks.append(Line(x[:1], y[:1], colour=colour, marker="open", size=8.0, joined=False))
        marks.append(Line(x[-1:], y[-1:], colour=colour, marker="square", size=7.0, joined=False))
    plan = Panel(tuple(marks), "y north [m]", "x east [m]", timed=False, equal=True)
    least, pair = least_over_time(flight.fleet), nearest(flight.fleet)
    marks_over_time = (Line(flight.truth.times[: len(least)], least), Level(pair.distance))
    separation = Panel(marks_over_time, "minimum separation [m]", column=1)
    caption = (
        f"All vehicles from above, north up (left; open: start, square: end), and their minimum separation. {pair}."
    )
    return Plot((plan, separation), caption, 4.9, (1.0,), (1.0, 1.0))
