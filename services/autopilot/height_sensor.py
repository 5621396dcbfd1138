"""Which sensor tells the filter how far the ground is."""

from lapwing.cosim.scene import Scene
from lapwing.services.common import ports

DOWN = -90.0  # [deg] elevation of a ray that meets the ground under a level vehicle


def distance_sensor(scene: Scene) -> str | None:
    """The sonar; where there is none, a rangefinder that looks straight down; None without either."""
    carried = scene.tables("sensors")
    if ports.SONAR in carried:
        return ports.SONAR
    looks_down = ports.RANGEFINDER in carried and scene.lookup("sensors.rangefinder.elevation_deg") == DOWN
    return ports.RANGEFINDER if looks_down else None
