"""Rotors of one body: one mesh each, thus one draw call, for discs, blades and thrust arrows."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from lapwing.studies.view3d.bodies import Rotor
from lapwing.studies.view3d.solids import Solid, arrow, disc, merge
from lapwing.studies.view3d.surroundings import add_solid

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
