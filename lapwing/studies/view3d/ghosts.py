"""Translucent copies of a vehicle's body: where it should be, and where its estimator believes that it is."""

from typing import Any

import numpy as np

from lapwing.studies.view3d.bodies import Body
from lapwing.studies.view3d.solids import Solid, join_meshes, raise_point, rod
from lapwing.studies.view3d.surroundings import add_solid

OPACITY, STEP = 0.4, 0.1  # greatest, and by which it changes
HIDDEN, FULL = 0.05, 0.35  # distances from the body itself, in sizes of the body


class Ghost:
    """A copy of a body in one colour and one draw call. It fades out where it would cover the body itself."""

    def __init__(self, scene: Any, body: Body, colour: str, name: str):
        """Add the nodes, hidden."""
        discs = [
            rod(raise_point(r.hub, 0.05 * r.radius), raise_point(r.hub, 0.06 * r.radius), r.radius, "")
            for r in body.rotors
        ]
        solids = [solid for solid in (*body.solids, *discs) if len(solid.faces)]
        self._opacity, self._mesh = 0.0, None
        scene.add_frame(name, show_axes=False)
        if not solids:
            return
        vertices, faces = join_meshes(solids)
        self._size = float(np.linalg.norm(vertices, axis=1).max())
        self._mesh = add_solid(scene, f"{name}/body", Solid(vertices, faces, colour, OPACITY), visible=False)

    def show(self, place: np.ndarray, attitude: np.ndarray, own: np.ndarray, own_attitude: np.ndarray) -> None:
        """Move the ghost to a place [m] and attitude w, x, y, z, and fade it by its distance from those of the body.

        A place or attitude that is not a number, as before the first setpoint of a recorded flight, hides the ghost.
        """
        if self._mesh is None:
            return
        turn = 2.0 * np.arccos(np.clip(abs(float(attitude @ own_attitude)), 0.0, 1.0))
        apart = float(np.linalg.norm(place - own)) / self._size + turn
        share = np.clip((apart - HIDDEN) / (FULL - HIDDEN), 0.0, 1.0) if np.isfinite(apart) else 0.0
        opacity = round(STEP * round(OPACITY * share / STEP), 2)
        if opacity != self._opacity:
            if (opacity > 0.0) != (self._opacity > 0.0):
                self._mesh.visible = opacity > 0.0
            if opacity > 0.0:
                self._mesh.opacity = opacity
            self._opacity = opacity
        if opacity > 0.0:
            self._mesh.position, self._mesh.wxyz = tuple(place.tolist()), tuple(attitude.tolist())
