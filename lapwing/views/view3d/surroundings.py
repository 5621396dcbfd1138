"""Ground, terrain, obstacles, fences and flight plan of a scene in the 3D view."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.terrain.terrain_queries import Level, surface
from lapwing.flights.flight_data import FlightData
from lapwing.flights.plan_shapes import fence_shapes, waypoints
from lapwing.services.common.schemas.environment_schema import Terrain
from lapwing.views.report.style import AXIS_COLOURS, BOUND, QUIET
from lapwing.views.view3d.solids import Solid, ball, box, merge, rod

SKY = ((126, 170, 205), (226, 236, 242))  # red, green, blue at the top and at the horizon
SOIL, LINE, WIDE_LINE = (214, 219, 215), (190, 197, 193), (160, 168, 164)
OBSTACLE, EARTH = "#AEB9C2", "#B9C2B4"
DAYLIGHT = 2.4  # intensity of the light from the sky, in addition to the sun
POINTS = 81  # points of the terrain along each side
EVERY, LIFT = 8, 0.02  # points of the terrain between two grid lines; [m] height of lines above the ground
MARGIN = 30.0  # [m] width of the terrain around the flight
FENCE_HEIGHT = 12.0  # [m] minimum height of a drawn fence
POSTS = 16  # maximum number of posts of a fence


def add_ground(scene: Any, low: float) -> None:
    """Add the sky, lights, and an infinite grid at the height `low` [m]."""
    scene.set_up_direction("+z")
    scene.world_axes.visible = False
    share = np.linspace(0.0, 1.0, 128)[:, None, None] ** 0.8
    sky = (1.0 - share) * np.array(SKY[0]) + share * np.array(SKY[1])
    scene.configure_environment_map(None)  # it would give the same light for half of the rendering time
    scene.add_light_hemisphere("/daylight", sky_color=(235, 243, 255), ground_color=(190, 186, 178), intensity=DAYLIGHT)
    scene.set_background_image(np.repeat(sky, 8, axis=1).astype(np.uint8), format="png")
    scene.add_grid(
        "/ground",
        infinite_grid=True,
        cell_size=1.0,
        section_size=10.0,
        cell_color=LINE,
        section_color=WIDE_LINE,
        plane_color=SOIL,
        plane_opacity=1.0,
        shadow_opacity=0.5,
        fade_distance=180.0,
        position=(0.0, 0.0, low),
    )


def add_surroundings(scene: Any, flight: FlightData) -> None:
    """Add ground, terrain, obstacles, fence and plan of the scene of a flight."""
    tree = flight.origin.scene.get("environment", {}).get("terrain", {})
    try:
        terrain = Terrain.model_validate({k: v for k, v in tree.items() if v is not None})
        relief = terrain.model_copy(update={"box": (), "cylinder": ()}).ground()
    except (ValueError, ConfigError):
        terrain, relief = Terrain(), Level()
    solids = list(_obstacles(terrain))
    low = -0.002
    if not isinstance(relief, Level):
        relief_solid = _relief(relief, flight.truth.position)
        low = float(relief_solid.vertices[:, 2].min()) - 0.05
        # a thin surface would cast a pattern of shadows on itself
        add_solid(scene, "/surroundings/relief", relief_solid, cast_shadow=False)
        lines = _relief_lines(relief_solid.vertices.reshape(POINTS, POINTS, 3))
        scene.add_line_segments("/surroundings/lines", lines, WIDE_LINE, thickness=1.0, thickness_units="screen")
    add_ground(scene, low)
    segments, colours = _fence(flight)
    if len(segments):
        scene.add_line_segments("/surroundings/fence", segments, colours, thickness=2.0, thickness_units="screen")
    solids += _plan(flight)
    for k, solid in enumerate(merge(solids)):
        add_solid(scene, f"/surroundings/{k}", solid)


def add_solid(scene: Any, name: str, solid: Solid, **options: Any) -> Any:
    """Add the mesh of a solid and return its handle."""
    opaque = solid.opacity >= 1.0
    return scene.add_mesh_simple(
        name,
        np.asarray(solid.vertices, np.float32),
        np.asarray(solid.faces, np.uint32),
        color=rgb(solid.colour),
        opacity=None if opaque else solid.opacity,
        flat_shading=True,
        side="double" if solid.open else "front",
        **{"cast_shadow": opaque, **options},
    )


def rgb(colour: str) -> tuple[int, int, int]:
    """Return red, green and blue of "#RRGGBB"."""
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)


def _obstacles(terrain: Terrain) -> Iterator[Solid]:
    for block in terrain.box:
        solid = box((0.0, 0.0, 0.5 * block.top), (*block.size, max(abs(block.top), 0.01)), OBSTACLE)
        c, s = np.cos(block.heading), np.sin(block.heading)
        rotated = solid.vertices @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        yield solid._replace(vertices=rotated + np.array([*block.position, 0.0]))
    for post in terrain.cylinder:
        yield rod((*post.position, 0.0), (*post.position, post.top), post.radius, OBSTACLE)


def _relief(relief: Any, path: np.ndarray) -> Solid:
    """Return the surface of the ground around a path [m], shape (n, 3)."""
    low, high = path[:, :2].min(axis=0) - MARGIN, path[:, :2].max(axis=0) + MARGIN
    x, y = (np.linspace(low[i], high[i], POINTS) for i in (0, 1))
    heights = np.array([[surface(relief, float(a), float(b))[0] for a in x] for b in y])
    grid_x, grid_y = np.meshgrid(x, y)
    vertices = np.column_stack([grid_x.ravel(), grid_y.ravel(), heights.ravel()])
    corner = (np.arange(POINTS - 1)[:, None] * POINTS + np.arange(POINTS - 1)).ravel()
    one = np.column_stack([corner, corner + 1, corner + POINTS + 1])
    other = np.column_stack([corner, corner + POINTS + 1, corner + POINTS])
    return Solid(vertices, np.concatenate([one, other]), EARTH, open=True)


def _relief_lines(points: np.ndarray) -> np.ndarray:
    """Return the segments [m] of a grid on the surface at points (rows, columns, 3), shape (n, 2, 3)."""
    raised = points + np.array([0.0, 0.0, LIFT])
    lines = (raised[::EVERY], raised[:, ::EVERY].swapaxes(0, 1))
    pairs = [np.stack([grid[:, :-1], grid[:, 1:]], axis=2).reshape(-1, 2, 3) for grid in lines]
    return np.concatenate(pairs).astype(np.float32)


def _fence(flight: FlightData) -> tuple[np.ndarray, np.ndarray]:
    """Return rails and posts of the fence: segments (n, 2, 3) [m] and their colours (n, 2, 3), orange for exclusion.

    Lines do not hide the ground behind them, unlike a translucent wall.
    """
    top = max(FENCE_HEIGHT, float(flight.truth.position[:, 2].max()) + 2.0)
    segments, colours = [np.empty((0, 2, 3))], [np.empty((0, 2, 3))]
    for shape in fence_shapes(flight):
        ground, corners = (np.column_stack([shape.corners, np.full(len(shape.corners), z)]) for z in (LIFT, top))
        rails = [ground + share * (corners - ground) for share in (0.0, 0.5, 1.0)]
        parts = [np.stack([rail, np.roll(rail, -1, axis=0)], axis=1) for rail in rails]
        every = -(-len(ground) // POSTS)
        parts.append(np.stack([ground, corners], axis=1)[::every])
        segments += parts
        colour = rgb(AXIS_COLOURS[2] if shape.stay_in else BOUND)
        colours += [np.broadcast_to(colour, part.shape) for part in parts]
    return np.concatenate(segments), np.concatenate(colours).astype(np.uint8)


def _plan(flight: FlightData) -> Iterator[Solid]:
    """Yield the waypoints of the plan as balls on thin posts."""
    for point in waypoints(flight):
        yield ball(point, 0.15, BOUND)
        yield rod((point[0], point[1], 0.0), point, 0.02, QUIET)
