"""A picture of a flown mission: position over time, and the path in space.

python -m studies.report.picture recordings/LOG.mcap docs/pictures/mission.png
"""

import sys
from pathlib import Path

from studies.flight import AXES, Flight
from studies.report.paper import write_png
from studies.report.plot import Line, Panel, Plot, reference
from studies.report.plots.path import space
from studies.report.whole import over


def draw(flight: Flight, target: Path) -> None:
    """Write the picture as PNG."""
    t, followed = flight.truth.times, flight.reference
    panels = []
    for row, name in enumerate(AXES[:3]):
        marks = (
            Line(t, flight.truth.position[:, row], "flown", width=2.0),
            reference(t[: len(followed)], followed[:, row]),
        )
        panels.append(Panel(marks, f"{name} [m]", row=row))
    panels.append(space(flight)._replace(column=1, rows=3))
    write_png(target, [Plot(tuple(panels), "", 4.6, (1.0,) * 3, (1.35, 1.0), **over(flight))])


if __name__ == "__main__":
    draw(Flight.read(Path(sys.argv[1])), Path(sys.argv[2]))
