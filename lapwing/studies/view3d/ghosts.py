"""Translucent copies of a vehicle's body at its reference pose and at its estimated pose."""

from typing import Any

import numpy as np

from lapwing.studies.view3d.bodies import Body
from lapwing.studies.view3d.solids import Solid, disc, join_meshes
from lapwing.studies.view3d.surroundings import add_solid

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
