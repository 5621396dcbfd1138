"""Nodes of the vehicles of a flight in a viser scene, and their motion."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from lapwing.flights.flight_data import FlightData
from lapwing.flights.rotation_arrays import rotate
from lapwing.views.report.style import BOUND, FLOWN
from lapwing.views.view3d.bodies import Body, Link, Motion, Rotor, cable
from lapwing.views.view3d.samples import Beam, Samples
from lapwing.views.view3d.sampling import along, dashes
from lapwing.views.view3d.scans import ScanPoints
from lapwing.views.view3d.solids import Solid, arrow, ball, box, coloured_mesh, disc, join_meshes, merge, raise_point
from lapwing.views.view3d.surroundings import add_solid, rgb
from lapwing.views.view3d.vehicle_bodies import motion

WIND, FORCE, DESIRED, ESTIMATE = "#56B4E9", BOUND, "#4A5560", "#CC79A7"
GHOSTS = {"reference": DESIRED, "estimate": ESTIMATE}
SCAN_COLOURS = {"lidar": BOUND, "depth_camera": "#882255"}
FLOWN_WIDTH, DESIRED_WIDTH, CABLE_WIDTH = 4.0, 2.0, 2.5  # [pixel]
DASH, MOST_DASHES = 0.2, 750  # length of a dash of the desired path over the size of the vehicle; number of dashes
WIND_SCALE = 0.12  # [m] of arrow for 1 m/s
SIGMAS = 3.0  # standard deviations of the drawn ellipsoid
EVERY = 3  # frames between two updates of an arrow
_ELLIPSOID = ball((0.0, 0.0, 0.0), 1.0, ESTIMATE, 0.3)
# Colour scale of a trail, from no error to the largest, distinct in hue and lightness.
SCALE = np.array([(0, 76, 140), (0, 142, 170), (86, 180, 110), (222, 186, 40), (224, 110, 20)], float)


class Vehicle:
    """Nodes of one vehicle: its bodies, arrows and ghosts."""

    def __init__(
        self,
        scene: Any,
        number: int,
        flight: FlightData,
        name: str,
        colour: str,
        ghost: bool = False,
        named: bool = False,
    ):
        """Add the nodes; `number` makes their paths unique, `named` writes the name above the vehicle."""
        self.name, self.colour, self.motion = name, colour, motion(flight)
        self._is_ghost = ghost
        self._scene, self._root = scene, f"/{number} {name.replace('/', '_')}"
        self._sent: dict[tuple[str, str], Any] = {}
        self._size = reach(self.motion)
        self._frames: list[Any] = []
        self._rotors: list[Rotors | None] = []
        self._per_newton = self._thrust_scale()
        self._optional: dict[str, Any] = {}
        self._beams: dict[str, Beam] = {}
        for k, body in enumerate(self.motion.bodies):
            self._add_body(f"{self._root}/{k} {body.name.replace('/', '_')}", body, ghost)
        if named:
            scene.add_label(f"{self._frames[0].name}/label", name, position=(0.0, 0.0, 0.9 * self._size))

    def _add_body(self, node: str, body: Body, ghost: bool) -> None:
        self._frames.append(self._scene.add_frame(node, show_axes=False))
        solids = [s._replace(colour=self.colour, opacity=0.45) if ghost else s for s in body.solids]
        opaque = merge(solid for solid in solids if solid.opacity >= 1.0)
        if len(opaque) > 1:
            self._scene.add_glb(f"{node}/body", coloured_mesh(opaque))
        for k, solid in enumerate(merge(solid for solid in solids if len(opaque) < 2 or solid.opacity < 1.0)):
            add_solid(self._scene, f"{node}/solid {k}", solid)
        scale = 0.0 if ghost else self._per_newton
        rotors = Rotors(self._scene, node, body.rotors, self.colour, scale) if body.rotors else None
        self._rotors.append(rotors)

    def _thrust_scale(self) -> float:
        """Return the length of a thrust arrow for 1 N [m]: 1.6 radii at the mean thrust."""
        result = [
            (r.thrust[r.thrust > 0.0], r.radius) for b in self.motion.bodies for r in b.rotors if r.thrust is not None
        ]
        means = [(float(thrust.mean()), radius) for thrust, radius in result if len(thrust)]
        return 1.6 * max(radius for _, radius in means) / max(mean for mean, _ in means) if means else 0.02

    def _arrow(self, name: str, colour: str, radius: float) -> Any:
        return add_solid(self._scene, name, arrow(colour, radius), visible=False)

    def _node(self, name: str, make: Any) -> Any:
        if name not in self._optional:
            self._optional[name] = make(f"{self._root}/{name}")
        return self._optional[name]

    def show(self, samples: Samples, k: int) -> None:
        """Move all nodes to the k-th sample."""
        for frame, rotors, body in zip(self._frames, self._rotors, samples.bodies, strict=True):
            self._set(frame, "position", body.position[k])
            self._set(frame, "wxyz", body.orientation[k])
            if rotors is not None and body.angles is not None:
                rotors.set_angles(body.angles[k])
            if rotors is not None and body.thrusts is not None and k % EVERY == 0:
                rotors.set_thrusts(body.thrusts[k])
        position = samples.bodies[0].position[k]
        if samples.wind is not None:
            tint, above = (self.colour, 1.1) if self._is_ghost else (WIND, 0.75)  # two flights may be in one place
            node = self._node("wind", lambda name: self._arrow(name, tint, 0.035 * self._size))
            self._point(node, raise_point(position, above * self._size), samples.wind[k], WIND_SCALE, k)
        self._show_ghosts(samples, k)
        self._show_forces(samples, k)
        for beam in samples.beams:
            if beam.name not in self._beams:
                self._beams[beam.name] = Beam(self._scene, self._frames[0].name, beam, self._size)
            if not k % EVERY:
                self._beams[beam.name].show(beam, k)
        for scan in samples.scans:
            colour = rgb(SCAN_COLOURS[scan.name])
            self._node(scan.name, partial(ScanPoints, self._scene, colour)).show(scan, k)
        for link in self.motion.links:
            self._show_link(link, samples, k)

    def _show_ghosts(self, samples: Samples, k: int) -> None:
        """Show the ghosts of reference and estimate, and the error ellipsoid of the estimated position."""
        body = samples.bodies[0]
        own = (body.position[k], body.orientation[k])
        for name, places, attitudes in (
            ("reference", samples.desired, samples.desired_attitude),
            ("estimate", samples.estimate, samples.estimate_attitude),
        ):
            if places is not None and attitudes is not None and not self._is_ghost:
                ghost = self._node(name, partial(Ghost, self._scene, self.motion.bodies[0], GHOSTS[name]))
                ghost.show(np.round(places[k], 3), attitudes[k], *own)
        if samples.estimate is None or samples.estimate_std is None or self._is_ghost:
            return
        ellipsoid = self._node("estimate/ellipsoid", lambda name: add_solid(self._scene, name, _ELLIPSOID))
        self._set(ellipsoid, "position", np.round(samples.estimate[k], 3))
        if not k % EVERY:
            sizes = (SIGMAS * samples.estimate_std[k]).clip(0.01, 50.0)
            self._set(ellipsoid, "scale", np.round(sizes, 2))

    def _show_forces(self, samples: Samples, k: int) -> None:
        pushes = []
        if samples.contacts is not None and samples.contact_forces is not None:
            pushes = list(zip(samples.contacts[k], samples.contact_forces[k], strict=True))
        for i, (place, force) in enumerate(pushes):
            node = self._node(f"force {i + 1}", lambda name: self._arrow(name, FORCE, 0.03 * self._size))
            self._point(node, place, force, self._per_newton, k)

    def _show_link(self, link: Link, samples: Samples, k: int) -> None:
        first, second = samples.bodies[link.first], samples.bodies[link.second]
        start = first.position[k] + rotate(first.orientation[k], np.array(link.hook))
        stop = second.position[k]
        is_slack = second.force is None or not np.any(second.force[k])
        points = cable(start, stop, link.length if is_slack else 0.0)
        pairs = np.stack([points[:-1], points[1:]], axis=1).astype(np.float32)
        handle = self._node(f"link {link.second}", lambda name: _lines(self._scene, name, pairs, BLADE, CABLE_WIDTH))
        handle.points = pairs

    def _lengthen(self, handle: Any, length: float) -> None:
        self._set(handle, "visible", length > SHORTEST)
        if length > SHORTEST:
            self._set(handle, "scale", (1.0, 1.0, round(length, 2) or 0.01))

    def _point(self, handle: Any, place: np.ndarray, vector: np.ndarray, scale: float, k: int) -> None:
        self._set(handle, "position", np.round(place, 3))
        if k % EVERY == 0:
            self._set(handle, "wxyz", along(vector[None, :])[0])
            self._lengthen(handle, scale * float(np.linalg.norm(vector)))

    def _set(self, handle: Any, field: str, value: Any) -> None:
        """Set a property if its value differs: a recording stores changes only."""
        plain = value if isinstance(value, bool) else tuple(float(v) for v in value)
        if self._sent.get((handle.name, field)) != plain:
            self._sent[handle.name, field] = plain
            setattr(handle, field, plain)

    def trail(
        self, path: np.ndarray, error: np.ndarray | None, most: float, name: str = "trail", line: Any = None
    ) -> Any:
        """Add a line of the path, or set the path in an existing `line`.

        Args:
            path: positions [m], world, shape (n, 3).
            error: error at each position [m] for the colours, shape (n,); None: the colour of the vehicle.
            most: error [m] at the end of the colour scale.
            name: name of the node below that of the vehicle.
            line: handle of an existing line; None: add one.

        Returns:
            The handle of the line.
        """
        points = np.stack([path[:-1], path[1:]], axis=1).astype(np.float32)
        colours: Any = np.array(rgb(self.colour), np.uint8)
        if error is not None and most > 0.0:
            ends = error_colours(error / most)
            colours = np.stack([ends[:-1], ends[1:]], axis=1)
        if line is None:
            return _lines(self._scene, f"{self._root}/{name}", points, colours, FLOWN_WIDTH)
        line.points, line.colors = points, colours
        return line

    def desired_path(self, path: np.ndarray) -> None:
        """Add the desired path, shape (n, 3) [m], as a thin dashed line."""
        points = dashes(path, DASH * self._size, MOST_DASHES).astype(np.float32)
        if len(points):
            _lines(self._scene, f"{self._root}/desired path", points, DESIRED, DESIRED_WIDTH)


def add_shaders(scene: Any) -> None:
    """Add specks with the materials of vehicles: the first drawing of a material compiles its shaders for seconds."""
    speck = box((0.0, 0.0, 0.0), (1e-4,) * 3, BLADE)
    for k, looks in enumerate((speck, speck._replace(open=True), speck._replace(opacity=0.5))):
        add_solid(scene, f"/speck {k}", looks)
    scene.add_glb("/speck of colours", coloured_mesh([speck]))
    _lines(scene, "/speck line", np.array([[[0.0, 0.0, 0.0], [0.0, 0.0, 1e-4]]], np.float32), BLADE, CABLE_WIDTH)


def reach(motion: Motion) -> float:
    """Return the size of the first body [m]: the distance of its farthest point or rotor tip, at least 0.1 m."""
    body = motion.bodies[0]
    tips = [float(np.linalg.norm(rotor.hub)) + rotor.radius for rotor in body.rotors]
    corners = [float(np.linalg.norm(solid.vertices, axis=1).max()) for solid in body.solids if len(solid.vertices)]
    return max([0.1, *tips, *corners])


def error_colours(share: np.ndarray) -> np.ndarray:
    """Return red, green, blue, shape (n, 3) uint8, of errors relative to the largest, shape (n,)."""
    grid = np.linspace(0.0, 1.0, len(SCALE))
    return np.column_stack([np.interp(share.clip(0.0, 1.0), grid, SCALE[:, i]) for i in range(3)]).astype(np.uint8)


def vehicle_colours(count: int, compared: bool) -> Sequence[str]:
    """Return the colours of compared flights, or of a single one; see `lapwing.views.report.style` for a fleet."""
    return (FLOWN, BOUND)[:count] if compared else (FLOWN,) * count


def _lines(scene: Any, name: str, points: np.ndarray, colour: Any, width: float) -> Any:
    colours = rgb(colour) if isinstance(colour, str) else colour
    return scene.add_line_segments(name, points, colours, thickness=width, thickness_units="screen")


OPACITY, STEP = 0.4, 0.1  # largest opacity, and its quantisation
HIDDEN, FULL = 0.05, 0.35  # distances from the body, over its size, up to which and from which opacity is constant


class Ghost:
    """Copy of a body in one colour and one draw call, which fades out close to the body."""

    def __init__(self, scene: Any, body: Body, colour: str, name: str):
        """Add the nodes, hidden."""
        discs = [disc(rotor.hub, rotor.radius, "") for rotor in body.rotors]
        solids = [solid for solid in (*body.solids, *discs) if len(solid.faces)]
        self._opacity, self._mesh = 0.0, None
        scene.add_frame(name, show_axes=False)
        if not solids:
            return
        vertices, faces = join_meshes(solids)
        self._size = float(np.linalg.norm(vertices, axis=1).max())
        self._mesh = add_solid(scene, f"{name}/body", Solid(vertices, faces, colour, OPACITY), visible=False)

    def show(self, position: np.ndarray, attitude: np.ndarray, own: np.ndarray, own_attitude: np.ndarray) -> None:
        """Move the ghost to a pose, and set its opacity by the distance from the body.

        Args:
            position: position of the ghost [m], world, shape (3,).
            attitude: attitude of the ghost, w, x, y, z, shape (4,).
            own: position of the body [m], world, shape (3,).
            own_attitude: attitude of the body, w, x, y, z, shape (4,).

        A pose with NaN, as before the first setpoint of a recorded flight, hides the ghost.
        """
        if self._mesh is None:
            return
        angle = 2.0 * np.arccos(np.clip(abs(float(attitude @ own_attitude)), 0.0, 1.0))
        distance = float(np.linalg.norm(position - own)) / self._size + angle
        share = np.clip((distance - HIDDEN) / (FULL - HIDDEN), 0.0, 1.0) if np.isfinite(distance) else 0.0
        opacity = round(STEP * round(OPACITY * share / STEP), 2)
        if opacity != self._opacity:
            if (opacity > 0.0) != (self._opacity > 0.0):
                self._mesh.visible = opacity > 0.0
            if opacity > 0.0:
                self._mesh.opacity = opacity
            self._opacity = opacity
        if opacity > 0.0:
            self._mesh.position, self._mesh.wxyz = tuple(position.tolist()), tuple(attitude.tolist())


BLADE, THRUST = "#20262B", "#009E73"
SHORTEST = 1e-3  # [m] shortest visible arrow
# Corners of two blades along x, over the radius, from tip to tip; they narrow towards the hub and the tips.
_BLADES = np.array([(0.95, 0.03), (0.95, -0.03), (0.35, 0.09), (0.35, -0.06), (0.0, 0.03), (0.0, -0.03)])
_OUTLINE = np.concatenate([_BLADES, -_BLADES[:4]])
_BLADE_FACES = np.array([(0, 2, 1), (1, 2, 3), (2, 4, 3), (3, 4, 5), (6, 8, 7), (7, 8, 9), (8, 5, 9), (9, 5, 4)])


class Rotors:
    """Nodes of the rotors of one body."""

    def __init__(self, scene: Any, body: str, rotors: Sequence[Rotor], colour: str, metres_per_newton: float):
        """Add the nodes below the node of the body; `metres_per_newton` scales the arrows, 0: no arrows."""
        self._scale = metres_per_newton
        self._hubs = np.array([rotor.hub for rotor in rotors])
        self._radii = np.array([rotor.radius for rotor in rotors])
        self._sent: dict[str, bytes] = {}
        up = 0.05 * self._radii
        self._blade_hubs = self._hubs + np.column_stack([0.0 * up, 0.0 * up, 1.2 * up])
        add_solid(scene, f"{body}/discs", merge(disc(rotor.hub, rotor.radius, colour, 0.28) for rotor in rotors)[0])
        initial = self._blade_vertices(np.zeros(len(rotors)))
        faces = np.concatenate([_BLADE_FACES + len(_OUTLINE) * k for k in range(len(rotors))])
        self._blades = add_solid(scene, f"{body}/blades", Solid(initial, faces, BLADE, open=True))
        self._arrows = None
        if metres_per_newton > 0.0 and all(rotor.thrust is not None for rotor in rotors):
            self._shapes = [arrow(THRUST, 0.04 * r, 0.75).vertices for r in self._radii]
            shape = arrow(THRUST, 1.0, 0.75)
            faces = np.concatenate([shape.faces + len(shape.vertices) * k for k in range(len(rotors))])
            solid = Solid(self._arrow_vertices(np.zeros(len(rotors))), faces, THRUST, 0.75)
            self._arrows = add_solid(scene, f"{body}/thrusts", solid)

    def set_angles(self, angles: np.ndarray) -> None:
        """Rotate the blades to the angles of the rotors [rad], shape (rotors,)."""
        self._set(self._blades, self._blade_vertices(angles))

    def set_thrusts(self, thrusts: np.ndarray) -> None:
        """Set the arrows to the thrusts of the rotors [N], shape (rotors,)."""
        if self._arrows is not None:
            self._set(self._arrows, self._arrow_vertices(np.round(self._scale * thrusts, 2)))

    def _blade_vertices(self, angles: np.ndarray) -> np.ndarray:
        c, s = np.cos(angles)[:, None], np.sin(angles)[:, None]
        x, y = (self._radii[:, None] * _OUTLINE[:, i] for i in (0, 1))
        flat = np.stack([c * x - s * y, s * x + c * y, np.zeros_like(x)], axis=2)
        return np.round(self._blade_hubs[:, None] + flat, 4).reshape(-1, 3)

    def _arrow_vertices(self, lengths: np.ndarray) -> np.ndarray:
        """Return vertices of arrows along z, or -z for a negative length; arrows near zero are points."""
        long = np.abs(lengths) > SHORTEST
        shapes = [
            hub + shape * ((1.0, np.sign(length), length) if shown else (0.0, 0.0, 0.0))
            for hub, shape, length, shown in zip(self._hubs, self._shapes, lengths, long, strict=True)
        ]
        return np.round(np.concatenate(shapes), 4)

    def _set(self, handle: Any, vertices: np.ndarray) -> None:
        """Set vertices if they differ: a recording stores changes only."""
        plain = vertices.astype(np.float32)
        if self._sent.get(handle.name) != plain.tobytes():
            self._sent[handle.name] = plain.tobytes()
            handle.vertices = plain
