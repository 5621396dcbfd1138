"""Choice of the distance sensor for the filter."""

from lapwing.cosim.scene import Scene
from lapwing.services.common import ports

DOWN = -90.0  # [deg] elevation of a vertical ray


def distance_sensor(scene: Scene) -> str | None:
    """Return the port of the sonar, or of a rangefinder that points straight down. Return None without either."""
    installed = scene.tables("sensors")
    if ports.SONAR in installed:
        return ports.SONAR
    points_down = ports.RANGEFINDER in installed and scene.lookup("sensors.rangefinder.elevation_deg") == DOWN
    return ports.RANGEFINDER if points_down else None
