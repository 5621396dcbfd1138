"""Film of the mission among buildings, its turn and landing: python docs/pictures/flight.py [FILE] (needs chromium)."""

import sys
from pathlib import Path

import lapwing
from lapwing.views.view3d.render import Shot, render

HERE = Path(__file__).parent
BUILDINGS = (  # x, y, width along x and y, top [m]
    (3.5, 5.5, 4.0, 4.0, 6.0),
    (-6.0, 4.0, 6.0, 5.0, 12.0),
    (21.0, 4.0, 5.0, 12.0, 13.0),
    (3.0, -7.0, 7.0, 5.0, 8.0),
    (12.0, -8.0, 5.0, 5.0, 11.5),
    (13.0, 19.0, 9.0, 5.0, 9.5),
)
SCENE = {
    "environment.terrain.box": [
        {"position": [x, y], "size": [length, width], "top": top} for x, y, length, width, top in BUILDINGS
    ],
    "sensors.lidar": {"rings": 16, "elevation_min_deg": -30.0, "elevation_max_deg": 10.0, "range_max": 25.0},
}
SHOT = Shot(start=54.0, stop=67.2, rate=12.0, speed=2.25, size=(800, 450), place=(-2.0, 1.1, -1.4))


def main(target: Path, shot: Shot = SHOT) -> None:
    """Fly the mission, and film its last seconds."""
    flight = lapwing.fly("delivery_mission", SCENE)
    render([flight], [flight.vehicle], target, shot)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE / "flight.webp")
