"""Wind and density of the air over time."""

from matplotlib.figure import Figure

from studies.flight import Flight
from studies.report.style import AXIS_COLOURS, FLOWN, STEERED, NotRecordedError, line, rows, shade_phases

ORDER = 80
TITLE = "Air: wind and density"
NEEDS = ("truth",)
MODELS = STEERED


def draw(flight: Flight) -> tuple[Figure, str]:
    """Wind in the world frame and density; of the two only what the log has."""
    t = flight.truth.times
    wind = flight.truth.wind
    density = flight.truth.air_density
    if not (wind.any() or density.any()):
        raise NotRecordedError("neither wind nor air density")
    figure, axes = rows(int(wind.any()) + int(density.any()))
    if wind.any():
        for component, colour, name in zip(wind.T, AXIS_COLOURS, "xyz", strict=True):
            line(axes[0, 0], t, component, color=colour, label=name)
        axes[0, 0].set_ylabel("wind [m/s]")
        axes[0, 0].legend(loc="upper right", ncols=3)
    if density.any():
        line(axes[-1, 0], t, density, color=FLOWN)
        axes[-1, 0].set_ylabel("air density [kg/m³]")
        axes[-1, 0].ticklabel_format(useOffset=False)
        axes[-1, 0].locator_params(axis="y", nbins=4)
    shade_phases(axes, flight)
    said = "" if wind.any() else " The log has no velocity of the wind."
    return figure, f"Velocity of the air in the world frame (ENU) and its density where the vehicle is.{said}"
