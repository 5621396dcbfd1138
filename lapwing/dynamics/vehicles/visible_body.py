"""Body of a vehicle as the rays of other vehicles' sensors meet it: an upright cylinder (theory, eq. (3.52))."""

from typing import TYPE_CHECKING, NamedTuple

from lapwing.dynamics.lie.quaternion import Quaternion, rotate_back
from lapwing.dynamics.terrain.ray_casting import between, within_circle
from lapwing.dynamics.vector import Vec3, dot, subtract
from lapwing.kernels import kernel, math

if TYPE_CHECKING:
    from lapwing.dynamics.vehicles.airframe import Airframe

UNKNOWN_ROTOR = 0.4  # radius of a rotor without [propeller] over the distance of its hub, as the 3D view draws it
HALF_HEIGHT = 0.1  # chosen: height of motors, blades and frame above and below the hubs over the body's radius


class VisibleBody(NamedTuple):
    """Cylinder around rotor discs, feet, hull and payload, closed at both ends, along z of the body."""

    x: float  # [m] of its axis, from the vehicle's origin, body
    y: float  # [m]
    radius: float  # [m]
    bottom: float  # [m] z of its lower end, body
    top: float  # [m]


def visible_body(airframe: "Airframe") -> VisibleBody:
    """Return the cylinder of an airframe whose positions are relative to the vehicle's origin."""
    hubs = airframe.rotors.position
    x, y = (math.total(hub[k] for hub in hubs) / len(hubs) for k in (0, 1))
    hub_distance = max(math.hypot(hub[0] - x, hub[1] - y) for hub in hubs)
    disc = 0.5 * airframe.propeller.diameter if airframe.propeller else UNKNOWN_ROTOR * hub_distance
    points = [*hubs, *((*airframe.contact.feet, *airframe.contact.hull) if airframe.contact else ())]
    if box := airframe.payload:
        (px, py, pz), (a, b, c) = box.position, (0.5 * edge for edge in box.size)
        points += [(px + i * a, py + j * b, pz + k * c) for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)]
    radius = max(hub_distance + disc, *(math.hypot(point[0] - x, point[1] - y) for point in points))
    heights = [point[2] for point in points] + [hub[2] + k * HALF_HEIGHT * radius for hub in hubs for k in (-1, 1)]
    return VisibleBody(x, y, radius, min(heights), max(heights))


@kernel
def distance_to_body(body: VisibleBody, position: Vec3, attitude: Quaternion, origin: Vec3, direction: Vec3) -> float:
    """Return the distance [m] along a unit vector to the body of a vehicle; inf without an intersection, 0 from within.

    Args:
        body: cylinder.
        position: [m] of the vehicle's origin, world.
        attitude: of the vehicle, body to world.
        origin: [m] of the ray, world.
        direction: unit vector of the ray, world.
    """
    apart = subtract(origin, position)
    across, along = abs(body.x) + abs(body.y) + body.radius, max(abs(body.bottom), abs(body.top))
    leaving, outside = dot(apart, direction), dot(apart, apart) - across * across - along * along
    if outside > 0.0 and (leaving >= 0.0 or leaving * leaving < outside):  # misses a sphere around the body
        return math.inf
    o, d = rotate_back(attitude, apart), rotate_back(attitude, direction)
    first, last = within_circle(o[0] - body.x, o[1] - body.y, d, body.radius)
    first, last = between(o[2], d[2], body.bottom, body.top, first, last)
    return first if first <= last else math.inf
