"""Roll, pitch, yaw and their errors over time (the paper's Figure 23)."""

from lapwing.flights.flight_data import FlightData
from lapwing.views.report.flight_phases import DEGREES, three_axes
from lapwing.views.report.plot import Plot

ORDER = 20
TITLE = "Attitude"
NEEDS = ("ground_truth",)


def draw(flight: FlightData) -> Plot:
    """Plot each angle in a row."""
    caption = "Attitude as roll, pitch and yaw."
    if len(flight.reference):
        caption += " The references of roll and pitch are those of the inner loops; that of yaw is the setpoint."
    return three_axes(flight, 3, DEGREES * flight.truth.attitude, "°", DEGREES, caption)
