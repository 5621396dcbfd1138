"""Triangle meshes of simple solids: boxes and solids of revolution."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

SIDES = 24  # number of sides of a solid of revolution
THIN = 10  # number of sides of a thin one
TIP = 1e-9  # [m] largest radius of a ring that counts as a point
_CORNERS = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
_SQUARES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))  # seen from outside
_BOX = np.array([face for a, b, c, d in _SQUARES for face in ((a, b, c), (a, c, d))])


Point = Sequence[float] | np.ndarray  # (3,) [m]


class Solid(NamedTuple):
    """Mesh of one colour in the frame of its body; triangles are counterclockwise seen from outside."""

    vertices: np.ndarray  # (n, 3) [m]
    faces: np.ndarray  # (m, 3) indices of `vertices`
    colour: str  # "#RRGGBB"
    opacity: float = 1.0
    open: bool = False  # visible from both sides; a translucent mesh is drawn twice


def box(centre: Point, size: Point, colour: str) -> Solid:
    """Return a box with a centre and edges along x, y, z [m]."""
    return Solid(_CORNERS * np.asarray(size, float) + np.asarray(centre, float), _BOX, colour)


def rod(start: Point, stop: Point, radius: float, colour: str, opacity: float = 1.0, sides: int = SIDES) -> Solid:
    """Return a cylinder between two points with a radius [m]; empty if the points coincide."""
    axis = np.subtract(stop, start).astype(float)
    length = float(np.linalg.norm(axis))
    if length < 1e-9:
        return Solid(np.empty((0, 3)), np.empty((0, 3), int), colour, opacity)
    upright = solid_of_revolution([(0.0, 0.0), (radius, 0.0), (radius, length), (0.0, length)], colour, opacity, sides)
    z = axis / length
    x = np.cross(z, (0.0, 0.0, 1.0) if abs(z[2]) < 0.9 else (1.0, 0.0, 0.0))
    x /= np.linalg.norm(x)
    frame = np.stack([x, np.cross(z, x), z])
    return upright._replace(vertices=upright.vertices @ frame + np.asarray(start, float))


def disc(hub: Point, radius: float, colour: str, opacity: float = 1.0) -> Solid:
    """Return the disc of a rotor about z, slightly above its hub: two flat cones, half of the faces of a cylinder."""
    solid = solid_of_revolution([(0.0, 0.05 * radius), (radius, 0.055 * radius), (0.0, 0.06 * radius)], colour, opacity)
    return solid._replace(vertices=solid.vertices + np.asarray(hub, float))


def ball(centre: Point, radius: float, colour: str, opacity: float = 1.0, sides: int = SIDES) -> Solid:
    """Return a sphere with a centre and a radius [m]."""
    angle = np.linspace(-0.5 * np.pi, 0.5 * np.pi, sides // 2 + 1)
    solid = solid_of_revolution(radius * np.column_stack([np.cos(angle), np.sin(angle)]), colour, opacity, sides)
    return solid._replace(vertices=solid.vertices + np.asarray(centre, float))


def raise_point(point: Point, height: float) -> np.ndarray:
    """Return the point raised by `height` [m]."""
    return np.asarray(point, float) + np.array([0.0, 0.0, height])


def arrow(colour: str, radius: float, opacity: float = 1.0) -> Solid:
    """Return an arrow of length 1 m from the origin along z."""
    head = 2.5 * radius
    return solid_of_revolution(
        [(0.0, 0.0), (radius, 0.0), (radius, 0.8), (head, 0.8), (0.0, 1.0)], colour, opacity, THIN
    )


def solid_of_revolution(
    profile: Sequence[Sequence[float]] | np.ndarray, colour: str, opacity: float = 1.0, sides: int = SIDES
) -> Solid:
    """Return the solid of revolution of a profile about z; its rows are radius and height [m] in ascending order."""
    rings = np.asarray(profile, float)
    angle = 2.0 * np.pi * np.arange(sides) / sides
    radius, height = rings[:, :1], np.repeat(rings[:, 1:], sides, axis=1)
    vertices = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=2).reshape(-1, 3)
    k, n = np.arange(sides), (np.arange(sides) + 1) % sides
    faces = []
    for i in range(len(rings) - 1):
        low, high = sides * i, sides * (i + 1)
        if abs(rings[i, 0]) > TIP:  # otherwise the ring is a point, and its triangles have no area
            faces.append(np.column_stack([low + k, low + n, high + n]))
        if abs(rings[i + 1, 0]) > TIP:
            faces.append(np.column_stack([low + k, high + n, high + k]))
    return Solid(vertices, np.concatenate(faces), colour, opacity)


def merge(solids: Iterable[Solid]) -> list[Solid]:
    """Join the solids of one colour and opacity, so that each is drawn in one call."""
    groups: dict[tuple[str, float, bool], list[Solid]] = {}
    for solid in solids:
        if len(solid.faces):
            groups.setdefault((solid.colour, solid.opacity, solid.open), []).append(solid)
    joined = []
    for (colour, opacity, is_open), group in groups.items():
        joined.append(Solid(*join_meshes(group), colour, opacity, is_open))
    return joined


def join_meshes(solids: Sequence[Solid]) -> tuple[np.ndarray, np.ndarray]:
    """Return the joint vertices and faces of solids."""
    starts = np.cumsum([0, *(len(solid.vertices) for solid in solids[:-1])])
    faces = [solid.faces + start for solid, start in zip(solids, starts, strict=True)]
    return np.concatenate([solid.vertices for solid in solids]), np.concatenate(faces)


def coloured_mesh(solids: Sequence[Solid]) -> bytes:
    """Return opaque solids as one binary glTF with vertex colours, drawn in one call.

    Without normals, the viewer uses flat shading. Needs trimesh.
    """
    import trimesh
    from trimesh.exchange.gltf import export_glb

    vertices, faces = join_meshes(solids)
    is_open = any(solid.open for solid in solids)
    material = trimesh.visual.material.PBRMaterial(metallicFactor=0.0, roughnessFactor=1.0, doubleSided=is_open)
    looks = trimesh.visual.TextureVisuals(material=material)
    looks.vertex_attributes["color"] = np.concatenate(
        [np.tile(linear_colour(solid.colour), (len(solid.vertices), 1)) for solid in solids]
    )
    return export_glb(trimesh.Trimesh(vertices, faces, visual=looks, process=False), include_normals=False)


def linear_colour(colour: str) -> np.ndarray:
    """Return linear red, green, blue and opacity 1 of an sRGB colour "#RRGGBB" scaled to 255, shape (4,) uint8."""
    values = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255.0
    shares = np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)
    return np.round(255.0 * np.append(shares, 1.0)).astype(np.uint8)
