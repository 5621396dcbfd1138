"""Reference and flown x, y, z over time (the paper's Figure 22)."""

import numpy as np
from matplotlib.figure import Figure

from studies.flight import AXES, Flight
from studies.report.style import DASHED, FLOWN, line, rows, shade_phases

ORDER = 10
TITLE = "Displacements: reference and flown"
NEEDS = ("truth",)


def draw(flight: Flight) -> tuple[Figure, str]:
    """One row for each axis of the world frame."""
    figure, axes = rows(3)
    on_axes(axes, flight)
    return (
        figure,
        "Position of the body frame in the world frame (ENU), from home: the true one, and the one asked for.",
    )


def on_axes(axes: np.ndarray, flight: Flight) -> None:
    """Draw into three rows of plots, shape (3, 1)."""
    t, position = flight.truth.times, flight.truth.position
    t_reference = t[: len(flight.reference)]
    for index, axis in enumerate(axes[:, 0]):
        line(axis, t, position[:, index], color=FLOWN, linewidth=2.0, label="flown")
        if len(t_reference):
            line(axis, t_reference, flight.reference[:, index], label="reference", **DASHED)
        axis.set_ylabel(f"{AXES[index]} [m]")
    axes[0, 0].legend(loc="best", ncols=2)
    shade_phases(axes, flight)
