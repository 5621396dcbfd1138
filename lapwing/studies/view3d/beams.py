"""Beams of distance sensors: a cone from the sensor to the measured point, and that point."""

from typing import Any, NamedTuple

import numpy as np

from lapwing.messages.topics import RANGEFINDER, SONAR
from lapwing.studies.flight_data import FlightData
from lapwing.studies.view3d.sampling import along, nearest
from lapwing.studies.view3d.solids import ball, solid_of_revolution
from lapwing.studies.view3d.surroundings import add_solid

TOPICS = {topic.name.removeprefix("{vehicle}/"): topic for topic in (SONAR, RANGEFINDER)}
COLOUR, POINT = "#E69F00", "#D55E00"
NARROWEST = np.radians(1.5)  # [rad] smallest half angle of a drawn beam
DOWN = -90.0  # [deg] default elevation of a beam


class BeamSamples(NamedTuple):
    """Readings of one distance sensor at k times."""

    name: str
    origin: tuple[float, float, float]  # [m] position of the sensor, body frame
    orientation: tuple[float, float, float, float]  # w, x, y, z: rotates z to the direction of the beam
    half_angle: float  # [rad]
    length: np.ndarray  # (k,) [m]; not finite without an echo


def beams(flight: FlightData, times: np.ndarray) -> list[BeamSamples]:
    """Return the beams of the distance sensors of a flight at `times` [s], shape (k,)."""
    sensors, result = flight.origin.scene.get("sensors", {}), []
    for name in TOPICS:
        if not flight.has(name) or not len(readings := flight.topic(name)):
            continue
        table = sensors.get(name, {})
        azimuth, elevation = (np.radians(table.get(f"{k}_deg", d)) for k, d in (("azimuth", 0.0), ("elevation", DOWN)))
        level = float(np.cos(elevation))
        direction = np.array([[level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)]])
        half = max(NARROWEST, 0.5 * float(readings.field_of_view[0]))
        length = readings.range[nearest(readings.times, times)].astype(float)
        x, y, z = table.get("position", (0.0, 0.0, 0.0))  # relative to the centre of mass, as in the simulation
        result.append(BeamSamples(name, (x, y, z), tuple(along(direction)[0].tolist()), half, length))
    return result


class Beam:
    """Nodes of a beam below the node of its body."""

    def __init__(self, scene: Any, body: str, samples: BeamSamples, size: float):
        """Add the nodes; `size` is the size of the vehicle [m], which scales the point."""
        self._width_ratio, self._length = float(np.tan(samples.half_angle)), 0.0
        frame = f"{body}/{samples.name}"
        scene.add_frame(frame, show_axes=False, position=samples.origin, wxyz=samples.orientation)
        cone = solid_of_revolution([(0.0, 0.0), (1.0, 1.0)], COLOUR, 0.22)._replace(open=True)
        self._cone = add_solid(scene, f"{frame}/cone", cone, visible=False)
        self._point = add_solid(scene, f"{frame}/point", ball((0.0,) * 3, 0.035 * size, POINT), visible=False)

    def show(self, samples: BeamSamples, k: int) -> None:
        """Show the k-th reading, rounded to 1 cm; hide the beam without an echo."""
        length = float(samples.length[k])
        length = round(length, 2) if np.isfinite(length) and length > 0.0 else 0.0
        if length == self._length:
            return
        for node in (self._cone, self._point):
            if (length > 0.0) != (self._length > 0.0):
                node.visible = length > 0.0
        self._length = length
        if length > 0.0:
            self._cone.scale = (length * self._width_ratio, length * self._width_ratio, length)
            self._point.position = (0.0, 0.0, length)
