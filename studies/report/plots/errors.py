"""Tracking error over time."""

from matplotlib.figure import Figure

from studies.flight import AXES, Flight
from studies.report.style import BOUND, FLOWN, STEERED, NotRecordedError, line, rows, shade_phases

ORDER = 30
TITLE = "Tracking error"
NEEDS = ("truth", "setpoint", "actuators")
MODELS = STEERED


def draw(flight: Flight) -> tuple[Figure, str]:
    """Translations on the left, angles on the right, each between plus and minus its root-mean-square error."""
    if not flight.armed.any():
        raise NotRecordedError("the motors are never armed")
    figure, axes = rows(3, columns=2)
    t = flight.truth.times[: len(flight.armed)][flight.armed]
    for (name, rmse), axis in zip(flight.rmse.items(), axes.T.flat, strict=True):
        unit = "m" if AXES.index(name) < 3 else "rad"
        line(axis, t, flight.errors[name], color=FLOWN, linewidth=0.9)
        for sign in (-1, 1):
            axis.axhline(sign * rmse, color=BOUND, linewidth=1.1, linestyle=(0, (5, 3)))
        axis.set_ylabel(f"{name} error [{unit}]")
        axis.set_title(f"RMSE {rmse:.4f} {unit}", color=BOUND, loc="right", pad=3)
    shade_phases(axes, flight)
    return figure, (
        "Reference minus truth while the motors are armed. Dashed: plus and minus the flight's root-mean-square error."
    )
