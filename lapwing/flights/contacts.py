"""Contacts of a vehicle with the ground, the obstacles of the terrain and other vehicles: times, places and speeds.

The log states only that a vehicle is touched. Which body touches it follows from its path and the scene's geometry.
"""

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from lapwing.dynamics.terrain import Relief
from lapwing.dynamics.terrain.heightfield import field
from lapwing.flights.rotation_arrays import from_xyzw, rotate, unit
from lapwing.flights.topic_view import TopicView
from lapwing.kernels import python_function
from lapwing.services.common.schemas.environment_schema import Terrain

BOUNCE = 0.5  # [s] shorter gaps between contacts do not separate two touches of a body
GROUND = "the ground"
WALL, ROOF = "wall", "roof"
PASSES = "passes"  # in place of the table of the effect `collision`, which may also be False: a hit does not count
TOUCHING = 1e-6  # [m] distance that counts as none
JOLT = 30.0  # [m/s^2] mean acceleration between two rows, above which the ground may have been touched meanwhile
HARD = 2.0  # [m/s] speed at a touch above which it is a crash, for all airframes: a fall from 0.2 m
MARGIN = 1.0  # [m] around an obstacle beyond which no distances are computed

Tables = Mapping[str, Any]
Neighbours = Mapping[str, tuple[TopicView, Tables]]  # true state and scene of the other vehicles, by name
Distances = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]  # [m] over the top, and from the nearest wall


class Touch(NamedTuple):
    """An interval of contact with one body, including bounces."""

    start: int  # row of the truth with the first contact
    stop: int  # row after the last contact
    speed: float  # [m/s] just before the hardest contact; 0 if the vehicle starts in contact
    body: str = GROUND
    face: str = ""  # WALL or ROOF of an obstacle; "" of other bodies
    first_speed: float = 0.0  # [m/s] just before the first contact; 0 if the vehicle starts in contact
    height: float = 0.0  # [m] of the vehicle's lowest point over the ground at the start, unless that is touched
    passes: bool = False  # a vehicle that this one passes through: the scene does not simulate the collision

    @property
    def crashes(self) -> bool:
        """True if the vehicle is lost."""
        return self.speed > HARD or self.passes

    @property
    def lands(self) -> bool:
        """True for a body on which a vehicle can stand; the speed is then that downwards, otherwise the whole one."""
        return self.body == GROUND or self.face == ROOF

    @property
    def where(self) -> str:
        """Name of the body, with the face of an obstacle: "building 1 (wall)"."""
        return f"{self.body} ({self.face})" if self.face else self.body

    @property
    def circumstances(self) -> str:
        """Speed, and height above ground of a contact in the air; of an obstacle at the first contact with it."""
        height = "" if self.body == GROUND else f", {max(self.height, 0.0):.1f} m above ground,"
        through = " and passes through it: the scene has no effects.collision" if self.passes else ""
        return f"{height} at {self.speed if self.lands or self.passes else self.first_speed:.2f} m/s{through}"


def contacts(truth: TopicView, scene: Tables, others: Neighbours) -> list[Touch]:
    """Return all contacts in order of their first time; empty for a plant without contact information.

    Args:
        truth: true state.
        scene: tables of the vehicle's scene.
        others: true state and tables of the other vehicles, by name.
    """
    if not len(truth) or "ground_contact" not in truth.fields:
        return []
    ground, points = truth.ground_contact.astype(bool), _points(scene)
    on_obstacle, result = np.zeros(len(truth), bool), []
    has_contact = "ground_contact" in _effects(scene)
    if has_contact:
        ground |= _jolted_by_ground(truth, scene, points)
    for name, above, beyond in _obstacles(truth, scene, points) if has_contact else ():
        distance = np.maximum(above, beyond).min(axis=1)
        touched = (distance <= TOUCHING) | _between_ticks(above, beyond)
        on_obstacle |= touched
        for start, stop in _intervals(touched):
            nearest = int(np.maximum(above[start], beyond[start]).argmin())
            face = ROOF if above[start, nearest] >= beyond[start, nearest] else WALL
            result.append(_touch(truth, start, stop, name, face))
    for start, stop in _intervals(ground):  # from the first row on at which no obstacle explains the contact
        free = np.flatnonzero(~on_obstacle[start:stop])
        if len(free):
            result.append(_touch(truth, start + int(free[0]), stop, GROUND, ""))
    for name, (other, tables) in others.items():
        gap, reach = gap_between(truth, other), _radius(scene) + _radius(tables)
        collision, its = (_effects(each).get("collision", PASSES) for each in (scene, tables))
        if collision is False or its is False:
            continue
        passes = collision == PASSES or its == PASSES
        met = _intervals(gap <= reach if passes else _meets(gap, reach))
        result += [_touch(truth, *rows, f"vehicle {name}", "", other)._replace(passes=passes) for rows in met]
    result = _merged(sorted(result), truth.times)
    if all(touch.body == GROUND for touch in result):
        return result
    lowest = lowest_point(truth, scene)
    return [t if t.body == GROUND else t._replace(height=lowest(t.start)) for t in result]


def gap_between(truth: TopicView, other: TopicView) -> np.ndarray:
    """Return the distance [m] of two vehicles over their common time, shape (n,)."""
    n = min(len(truth), len(other))
    return np.linalg.norm(truth.position[:n] - other.position[:n], axis=1)


def slope_at(scene: Tables, position: np.ndarray) -> float:
    """Return the tangent of the ground's steepest slope below a position, without obstacles."""
    relief = _relief(scene)
    return 0.0 if relief is None else float(np.hypot(*python_function(field)(relief, *position[:2].tolist())[1:]))


def _effects(scene: Tables) -> Tables:
    effects: Tables = scene.get("effects") or {}
    return effects


def _relief(scene: Tables, **changed: Any) -> Relief | None:
    """Return the terrain with changed keys; None if it is level."""
    with suppress(ValueError):  # tables of a former version
        terrain = (scene.get("environment") or {}).get("terrain") or {}
        ground = Terrain.model_validate({**terrain, **changed}).ground()
        return ground if isinstance(ground, Relief) else None
    return None


def _points(scene: Tables) -> np.ndarray:
    """Return the feet and the points of the hull [m], body, shape (n, 3)."""
    contact = (scene.get("airframe") or {}).get("contact") or {}
    return np.array([*contact.get("feet", ()), *contact.get("hull", ())], float).reshape(-1, 3)


def _radius(scene: Tables) -> float:
    """Return the radius [m] of the sphere around a vehicle's rotors, or that of its effect `collision`."""
    airframe = scene.get("airframe") or {}
    places = (airframe.get("rotors") or {}).get("position") or [(0.0, 0.0, 0.0)]
    tips = max(map(float, np.linalg.norm(places, axis=1))) + 0.5 * (airframe.get("propeller") or {}).get("diameter", 0)
    return float((_effects(scene).get("collision") or {}).get("radius") or tips)


def _obstacles(truth: TopicView, scene: Tables, points: np.ndarray) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Yield name, height over the top and distance from the walls [m] of each obstacle that the vehicle comes near.

    Both are negative within, and have the shape (n, points); they are infinite where the vehicle is far away.
    """
    relief = _relief(scene, grid=None)  # its validation takes long, and obstacles do not depend on it
    if relief is None or not len(points):
        return
    reach, centre = float(np.linalg.norm(points, axis=1).max()) + MARGIN, truth.position[:, None, :]
    for name, distances in _bodies(scene, relief):
        near = np.flatnonzero((np.maximum(*distances(centre)) < reach)[:, 0])
        if len(near):
            rows = slice(int(near[0]), int(near[-1]) + 1)
            above, beyond = (np.full((len(truth), len(points)), np.inf) for _ in range(2))
            above[rows], beyond[rows] = distances(_places(truth, points, rows))
            yield name, above, beyond


def _bodies(scene: Tables, relief: Relief) -> Iterator[tuple[str, Distances]]:
    """Yield the name of each obstacle, and the function of places (..., 3) that returns its distances."""
    terrain = scene["environment"]["terrain"]
    boxes, cylinders = terrain.get("box") or (), terrain.get("cylinder") or ()
    for i, row in enumerate(relief.boxes.tolist()):  # boxes, then steps
        name = (boxes[i].get("name") or f"building {i + 1}") if i < len(boxes) else f"step {i - len(boxes) + 1}"
        yield name, partial(_from_box, row)
    for i, row in enumerate(relief.cylinders.tolist()):
        yield cylinders[i].get("name") or f"tower {i + 1}", partial(_from_cylinder, row)


def _from_box(box: list[float], places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    x0, y0, c, s, first, last, half, top = box
    dx, dy = places[..., 0] - x0, places[..., 1] - y0
    u, v = c * dx + s * dy, c * dy - s * dx
    return places[..., 2] - top, np.maximum(np.maximum(first - u, u - last), abs(v) - half)


def _from_cylinder(cylinder: list[float], places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    x0, y0, radius, top = cylinder
    return places[..., 2] - top, np.hypot(places[..., 0] - x0, places[..., 1] - y0) - radius


def _places(truth: TopicView, points: np.ndarray, rows: slice) -> np.ndarray:
    """Return the points in world coordinates [m], shape (rows, points, 3)."""
    attitude = unit(from_xyzw(truth.orientation[rows]))
    return truth.position[rows, None, :] + np.stack(
        [rotate(attitude, np.tile(p, (len(attitude), 1))) for p in points], 1
    )


def _between_ticks(above: np.ndarray, beyond: np.ndarray) -> np.ndarray:
    """Return True at rows before which a point would have entered at its last speed: contacts shorter than a tick."""
    with np.errstate(invalid="ignore"):
        ahead = np.maximum(2.0 * above[1:-1] - above[:-2], 2.0 * beyond[1:-1] - beyond[:-2])
    entered = (ahead < 0.0) & np.isfinite(above[:-2])  # from infinity, the vehicle has just come near
    return np.concatenate([np.zeros(min(2, len(above)), bool), entered.any(axis=1)])


def _jolted_by_ground(truth: TopicView, scene: Tables, points: np.ndarray) -> np.ndarray:
    """Return True at rows before which a point has touched the ground for less than a tick, as a stiff foot does."""
    result = np.zeros(len(truth), bool)
    jolts = np.linalg.norm(np.diff(truth.velocity, axis=0), axis=1) > JOLT * np.diff(truth.times)
    jolts &= ~(truth.ground_contact[1:] | truth.ground_contact[:-1])
    rows = np.flatnonzero(jolts[1:]) + 2
    relief = _relief(scene) if len(rows) else None  # its validation takes long
    for row in rows:
        places = _places(truth, points, slice(row - 2, row))
        ground = np.array([[_ground_height(relief, x, y) for x, y, _ in each] for each in places])
        before, last = places[..., 2] - ground
        result[row] = (2.0 * last - before < 0.0).any()
    return result


def _ground_height(relief: Relief | None, x: float, y: float) -> float:
    return 0.0 if relief is None else float(python_function(field)(relief, float(x), float(y))[0])


def _meets(gap: np.ndarray, reach: float) -> np.ndarray:
    """Return True where two spheres touch, or have touched since the row before."""
    met = gap <= reach
    met[2:] |= 2.0 * gap[1:-1] - gap[:-2] < reach
    return met


def lowest_point(truth: TopicView, scene: Tables) -> Callable[[int], float]:
    """Return a function of a row: the height [m] of the vehicle's lowest point over the ground below its centre."""
    points, relief = _points(scene), _relief(scene)

    def height(row: int) -> float:
        x, y, z = truth.position[row].tolist()
        if len(points):
            z = float(_places(truth, points, slice(row, row + 1))[..., 2].min())
        return z - _ground_height(relief, x, y)

    return height


def _touch(truth: TopicView, start: int, stop: int, body: str, face: str, other: TopicView | None = None) -> Touch:
    velocity = truth.velocity[start - 1] if start else np.zeros(3)
    if other is not None and start:
        velocity = velocity - other.velocity[start - 1]
    touch = Touch(start, stop, 0.0, body, face)
    speed = max(-float(velocity[2]), 0.0) if touch.lands else float(np.linalg.norm(velocity))
    return touch._replace(speed=speed, first_speed=speed)


def _intervals(where: np.ndarray) -> list[tuple[int, int]]:
    """Return the rows (first, stop) of the intervals where `where` is True."""
    edges = np.flatnonzero(np.diff(where.astype(np.int8), prepend=0, append=0)).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))


def _merged(touches: list[Touch], times: np.ndarray) -> list[Touch]:
    """Return touches of the same body as one if only a bounce separates them."""
    result: list[Touch] = []
    last: dict[str, int] = {}  # place in `result` of the last touch of a body
    for touch in touches:
        k = last.get(touch.body)
        if k is not None and times[touch.start] - times[result[k].stop - 1] < BOUNCE:
            before = result[k]
            result[k] = before._replace(stop=max(before.stop, touch.stop), speed=max(before.speed, touch.speed))
        else:
            last[touch.body] = len(result)
            result.append(touch)
    return result
