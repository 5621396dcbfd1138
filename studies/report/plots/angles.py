"""Reference and flown roll, pitch, yaw over time (the paper's Figure 23)."""

from matplotlib.figure import Figure

from studies.flight import AXES, Flight
from studies.report.style import DASHED, FLOWN, line, rows, shade_phases

ORDER = 20
TITLE = "Angles: reference and flown"
NEEDS = ("truth",)


def draw(flight: Flight) -> tuple[Figure, str]:
    """One row for each angle."""
    figure, axes = rows(3)
    t, t_reference = flight.truth.times, flight.truth.times[: len(flight.reference)]
    for index, axis in enumerate(axes[:, 0]):
        line(axis, t, flight.truth.attitude[:, index], color=FLOWN, linewidth=1.6, label="flown")
        if len(t_reference):
            line(axis, t_reference, flight.reference[:, 3 + index], label="reference", **DASHED)
        axis.set_ylabel(f"{AXES[3 + index]} [rad]")
    axes[0, 0].legend(loc="best", ncols=2)
    shade_phases(axes, flight)
    return figure, (
        "Attitude as roll, pitch and yaw. The reference of roll and pitch is what the inner loops follow; "
        "that of yaw is the setpoint."
    )
