"""Film of the mission's last turn and landing: python docs/pictures/flight.py [FILE.webp] (needs chromium)."""

import sys
from pathlib import Path

import lapwing
from lapwing.studies.view3d.render import Shot, render

HERE = Path(__file__).parent
SHOT = Shot(start=44.0, stop=68.0, rate=12.0, speed=2.5, size=(800, 450), place=(-1.5, 0.6, -1.05))


def main(target: Path, shot: Shot = SHOT) -> None:
    """Fly the mission, and film its last seconds."""
    flight = lapwing.fly("delivery_mission")
    render([flight], [flight.vehicle], target, shot)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE / "flight.webp")
