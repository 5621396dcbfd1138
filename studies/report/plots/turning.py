"""Angular velocity of a satellite over time, and its path in phase space (the source's Figures 4 and 5)."""

import numpy as np
from matplotlib.figure import Figure

from studies.flight import Flight
from studies.report.style import AXIS_COLOURS, DPI, FLOWN, POINTS, WIDTH

ORDER = 15
TITLE = "Angular velocity"
NEEDS = ("truth",)
MODELS = ("gyrostat",)
PORTRAIT = 20_000  # points of the phase portrait at the most


def draw(flight: Flight) -> tuple[Figure, str]:
    """Three rates over time on the left, each pair of them on the right."""
    t, omega = flight.truth.times, flight.truth.angular_velocity
    unit, scale = ("h", 3600.0) if t[-1] > 3 * 3600.0 else ("s", 1.0)
    figure = Figure(figsize=(WIDTH, 6.2), dpi=DPI, layout="constrained")
    grid = figure.add_gridspec(3, 2, width_ratios=(1.7, 1.0))
    every = max(1, len(t) // POINTS)
    for i, colour in enumerate(AXIS_COLOURS):
        axis = figure.add_subplot(grid[i, 0])
        axis.plot(t[::every] / scale, omega[::every, i], color=colour, linewidth=0.8)
        axis.set_ylabel(f"ω{'xyz'[i]} [rad/s]")
        axis.margins(x=0.0)
    axis.set_xlabel(f"time [{unit}]")
    thin = omega[:: max(1, len(t) // PORTRAIT)]
    for i in range(3):
        first, second = i, (i + 1) % 3
        axis = figure.add_subplot(grid[i, 1])
        axis.plot(thin[:, first], thin[:, second], color=FLOWN, linewidth=0.3)
        axis.set(xlabel=f"ω{'xyz'[first]} [rad/s]", ylabel=f"ω{'xyz'[second]} [rad/s]")
        axis.ticklabel_format(style="sci", scilimits=(-2, 2))
    largest = np.linalg.norm(omega, axis=1).max()
    return (
        figure,
        f"Angular velocity in the body frame over time, and in pairs. Largest magnitude: {largest:.3g} rad/s.",
    )
