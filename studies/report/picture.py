"""A picture of a flown mission: position over time, and the path in space.

python -m studies.report.picture recordings/LOG.mcap docs/pictures/mission.png
"""

import sys
from pathlib import Path

from studies.flight import Flight
from studies.report.overview import overview
from studies.report.paper import write_png


def draw(flight: Flight, target: Path) -> None:
    """Write the picture as PNG."""
    write_png(target, [overview(flight)])


if __name__ == "__main__":
    draw(Flight.read(Path(sys.argv[1])), Path(sys.argv[2]))
