"""A picture of a flown mission: position over time, and the path in space.

python -m lapwing.studies.report.overview_image recordings/LOG.mcap docs/pictures/mission.png
"""

import sys
from pathlib import Path

from lapwing.studies.flight_data import FlightData
from lapwing.studies.report.matplotlib_figure import write_png
from lapwing.studies.report.overview import overview


def draw(flight: FlightData, target: Path) -> None:
    """Write the picture as PNG."""
    write_png(target, [overview(flight)])


if __name__ == "__main__":
    draw(FlightData.read(Path(sys.argv[1])), Path(sys.argv[2]))
