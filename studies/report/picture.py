"""A picture of a flown mission: displacements over time, and the path in space.

python -m studies.report.picture recordings/LOG.mcap docs/pictures/mission.png
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from studies.flight import Flight
from studies.report.plots import displacements, path
from studies.report.style import DPI, WIDTH, styled


def drawn(flight: Flight) -> Figure:
    """The picture, within the report's style."""
    figure = Figure(figsize=(1.15 * WIDTH, 4.6), layout="constrained")
    grid = figure.add_gridspec(3, 2, width_ratios=(1.35, 1.0))
    axes = np.array([[figure.add_subplot(grid[row, 0])] for row in range(3)])
    for axis in axes[:-1, 0]:
        axis.tick_params(labelbottom=False)
    displacements.on_axes(axes, flight)
    axes[-1, 0].set_xlabel("time [s]")
    path.space(figure.add_subplot(grid[:, 1], projection="3d"), flight)
    return figure


def draw(flight: Flight, target: Path) -> None:
    """Write the picture as PNG."""
    with styled():
        drawn(flight).savefig(target, dpi=DPI, metadata={"Software": None})


if __name__ == "__main__":
    draw(Flight.read(Path(sys.argv[1])), Path(sys.argv[2]))
