"""Position and its error over time (the paper's Figure 22)."""

from lapwing.flights.flight_data import FlightData
from lapwing.views.report.flight_phases import three_axes
from lapwing.views.report.plot import Plot

ORDER = 10
TITLE = "Position"
NEEDS = ("ground_truth",)


def draw(flight: FlightData) -> Plot:
    """Plot each axis of the world frame in a separate row."""
    caption = "Position of the body frame in the world frame (ENU), relative to home."
    return three_axes(flight, 0, flight.truth.position, "m", 1.0, caption)
