"""Position over time, and how far it is from what was asked (the paper's Figure 22)."""

from studies.flight import Flight
from studies.report.plot import Plot
from studies.report.whole import three_axes

ORDER = 10
TITLE = "Position"
NEEDS = ("truth",)


def draw(flight: Flight) -> Plot:
    """One row for each axis of the world frame."""
    said = "Position of the body frame in the world frame (ENU), from home."
    return three_axes(flight, 0, flight.truth.position, "m", 1.0, said)
