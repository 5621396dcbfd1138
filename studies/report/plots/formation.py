"""Quadrotors that carry a load: how well it follows its path, how the links hang, and the view from the side."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from studies.flight import Flight
from studies.report.style import AXIS_COLOURS, BOUND, DASHED, FLOWN, WIDTH

ORDER = 35
TITLE = "Load, links and quadrotors"
NEEDS = ("truth", "bodies", "lift")
MODELS = ("cooperative_load",)
COLOURS = (*AXIS_COLOURS, BOUND)
INSTANTS = 11  # pictures of the links


def draw(flight: Flight) -> tuple[Figure, str]:
    """Three plots over time on the left, the view from the side on the right."""
    t = flight.times("bodies")
    places = flight.topic("bodies").position
    wanted = _wanted(flight, t)
    error = np.linalg.norm(places[:, 0] - wanted, axis=1)
    figure = Figure(figsize=(WIDTH, 6.4), layout="constrained")
    grid = figure.add_gridspec(3, 2, width_ratios=(1.2, 1.0))
    axes = [figure.add_subplot(grid[i, 0]) for i in range(3)]
    axes[0].semilogy(t, error, color=FLOWN)
    axes[0].set_ylabel("load error [m]")
    links = places[:, :1] - places[:, 1:]
    angle = np.degrees(np.arctan2(links[..., 0], -links[..., 2]))
    thrust = flight.topic("lift").thrust
    for i in range(links.shape[1]):
        colour = COLOURS[i % len(COLOURS)]
        axes[1].plot(t, angle[:, i], color=colour, label=f"link {i + 1}")
        axes[2].plot(flight.times("lift"), thrust[:, i], color=colour, label=f"quadrotor {i + 1}")
    axes[1].set_ylabel("link from vertical [°]")
    axes[2].set(ylabel="thrust [N]", xlabel="time [s]")
    for axis in axes:
        axis.margins(x=0.0)
    for axis in axes[1:]:
        axis.legend(loc="best", ncols=2)
    side(figure.add_subplot(grid[:, 1]), places, wanted)
    return figure, (
        "Distance of the load from its path, the links' angles in the x-z plane and the thrusts; on the right the "
        f"whole from the side at {INSTANTS} instants. At the end the load is {error[-1]:.2g} m from its path."
    )


def side(axes: Axes, places: np.ndarray, wanted: np.ndarray) -> None:
    """The load's path and the links seen along y."""
    axes.plot(places[:, 0, 0], places[:, 0, 2], color=FLOWN, label="load")
    axes.plot(wanted[:, 0], wanted[:, 2], label="wanted path", **DASHED)
    for k in np.linspace(0, len(places) - 1, INSTANTS).astype(int):
        load = places[k, 0]
        for i, quad in enumerate(places[k, 1:]):
            colour = COLOURS[i % len(COLOURS)]
            axes.plot((quad[0], load[0]), (quad[2], load[2]), color=colour, linewidth=0.7)
            axes.plot(quad[0], quad[2], marker="s", markersize=4, color=colour)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel="x [m]", ylabel="z up [m]")
    axes.legend(loc="best")


def _wanted(flight: Flight, t: np.ndarray) -> np.ndarray:
    """The load's wanted path [m] at times t, shape (n, 3)."""
    path = np.array(flight.origin.scene["formation"]["path"])
    return path[0] + t[:, None] * path[1] + t[:, None] ** 2 * path[2]
