"""Wind and density of the air over time."""

from lapwing.studies.flight_data import FlightData
from lapwing.studies.report.flight_phases import over
from lapwing.studies.report.plot import Line, NotRecordedError, Panel, Plot, column
from lapwing.studies.report.style import AXIS_COLOURS, STEERED

ORDER = 80
TITLE = "Air: wind and density"
NEEDS = ("ground_truth",)
MODELS = STEERED


def draw(flight: FlightData) -> Plot:
    """Wind in the world frame and density; of the two only what the log has."""
    t, wind, density = flight.truth.times, flight.truth.wind, flight.truth.air_density
    if not (wind.any() or density.any()):
        raise NotRecordedError("neither wind nor air density")
    panels = []
    if wind.any():
        parts = zip("xyz", wind.T, AXIS_COLOURS, strict=True)
        panels.append(Panel(tuple(Line(t, part, name, colour) for name, part, colour in parts), "wind [m/s]"))
    if density.any():
        panels.append(Panel((Line(t, density),), "density [kg/m³]"))
    said = "" if wind.any() else " The log has no velocity of the wind."
    return Plot(
        caption=f"Velocity of the air in the world frame (ENU) and its density where the vehicle is.{said}",
        **column(panels, 1.9, **over(flight)),
    )
