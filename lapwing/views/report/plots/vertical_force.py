"""Net vertical force and rotor speeds of an uncontrolled quadrotor (the source's Figure 10)."""

from lapwing.flights.flight_data import FlightData
from lapwing.views.report.flight_phases import over
from lapwing.views.report.plot import Line, Panel, Plot, column
from lapwing.views.report.plots.motors import RPM
from lapwing.views.report.style import COLOURS

ORDER = 25
TITLE = "Net vertical force and rotor speeds"
NEEDS = ("ground_truth",)
MODELS = ("os4",)
DASHES = ("solid", "dash", "dot", "dashdot")  # lines of rotors with equal speed coincide


def draw(flight: FlightData) -> Plot:
    """Plot mass times vertical acceleration, and the speed of each rotor."""
    t = flight.truth.times
    force = flight.origin.scene["os4"]["mass"] * flight.truth.acceleration[:, 2]
    speeds = enumerate(zip((flight.truth.rotor_speed * RPM).T, COLOURS, DASHES, strict=False), 1)
    rotors = tuple(Line(t, speed, f"rotor {i}", colour, dash=dash) for i, (speed, colour, dash) in speeds)
    panels = Panel((Line(t, force),), "vertical force [N]"), Panel(rotors, "speed [rpm]")
    caption = (
        f"Resultant of thrust, weight and drag along the vertical: from {force[0]:.3g} N to {force[-1]:.3g} N. "
        "Below, the speed of each rotor."
    )
    return Plot(caption=caption, **column(panels, 2.0, **over(flight)))
