"""Net vertical force and rotor speeds of a quadrotor that nobody steers (the source's Figure 10)."""

from matplotlib.figure import Figure

from studies.flight import Flight
from studies.report.style import AXIS_COLOURS, BOUND, FLOWN, line, rows

ORDER = 25
TITLE = "Net vertical force and rotor speeds"
NEEDS = ("truth",)
MODELS = ("os4",)
RPM = 9.549296585513721  # of 1 rad/s


def draw(flight: Flight) -> tuple[Figure, str]:
    """Mass times vertical acceleration, and the speed of each rotor."""
    t = flight.truth.times
    mass = flight.origin.scene["os4"]["mass"]
    force = mass * flight.truth.acceleration[:, 2]
    figure, axes = rows(2)
    line(axes[0, 0], t, force, color=FLOWN)
    axes[0, 0].set_ylabel("vertical force [N]")
    speeds = flight.truth.rotor_speed * RPM
    looks = zip(speeds.T, (*AXIS_COLOURS, BOUND), ((0, ()), (0, (6, 2)), (0, (2, 2)), (0, (6, 2, 1, 2))), strict=True)
    for i, (speed, colour, dashes) in enumerate(looks, 1):
        line(axes[1, 0], t, speed, color=colour, linestyle=dashes, label=f"rotor {i}")
    axes[1, 0].set_ylabel("speed [rpm]")
    axes[1, 0].legend(loc="best", ncols=4)
    for axis in axes.flat:
        axis.margins(x=0.0)
        axis.ticklabel_format(useOffset=False)
    return figure, (
        f"Resultant of thrust, weight and drag along the vertical: from {force[0]:.3g} N to {force[-1]:.3g} N. "
        "Below, the speed of each rotor."
    )
