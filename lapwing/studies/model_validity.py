"""Where a flight leaves what its models are valid for: in the flow of its own rotors, off the terrain's grid."""

from typing import Any, NamedTuple

import numpy as np

from lapwing.studies.saturation import stretches
from lapwing.studies.topic_view import TopicView

# Of the rotors' induced velocity in hover: descent between these, slower across than this (after Leishman, Principles
# of Helicopter Aerodynamics, section 2.13: momentum theory has no solution that is measured there)
SLOWEST_DESCENT, FASTEST_DESCENT, FASTEST_ACROSS = 0.5, 1.5, 1.0


class ValidityWarning(NamedTuple):
    """A stretch of a flight where it is not to be trusted."""

    start: float  # [s]
    text: str


def warnings(truth: TopicView, scene: dict[str, Any]) -> list[ValidityWarning]:
    """All of a flight, in no order.

    Args:
        truth: the true state.
        scene: its tables.
    """
    found = []
    diameter = _table(scene, "airframe", "propeller").get("diameter")
    if diameter and {"rotor_thrust", "air_density", "wind"} <= set(truth.fields):
        for start, stop in stretches(in_vortex_ring(truth, diameter), truth.times):
            lasted = _seconds(truth, start, stop)
            text = f"descends into the vortex ring of its rotors for {lasted} s: their thrust is not sure there"
            found.append(ValidityWarning(float(truth.times[start]), text))
    grid = _table(scene, "environment", "terrain", "grid")
    if grid.get("heights"):
        for start, stop in stretches(off_the_grid(truth, grid), truth.times):
            lasted = _seconds(truth, start, stop)
            text = f"is beyond the edge of the terrain's grid for {lasted} s: the ground is level across it there"
            found.append(ValidityWarning(float(truth.times[start]), text))
    return found


def in_vortex_ring(truth: TopicView, diameter: float) -> np.ndarray:
    """Whether the rotors descend into their own flow, shape (n,) of bool.

    Args:
        truth: of n messages.
        diameter: of the rotors [m].
    """
    x, y, z, w = truth.orientation.T
    axis = np.column_stack([2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)])
    air = truth.velocity - truth.wind
    climb = (air * axis).sum(axis=1)
    across = np.linalg.norm(air - climb[:, None] * axis, axis=1)
    disc = 0.25 * np.pi * diameter**2 * truth.rotor_thrust.shape[1]
    thrust, density = truth.rotor_thrust.sum(axis=1), truth.air_density
    hover = np.sqrt(np.maximum(thrust, 0.0) / (2.0 * np.maximum(density, 1e-9) * disc))
    descends = (-climb > SLOWEST_DESCENT * hover) & (-climb < FASTEST_DESCENT * hover)
    return descends & (across < FASTEST_ACROSS * hover) & ~truth.ground_contact


def off_the_grid(truth: TopicView, grid: dict[str, Any]) -> np.ndarray:
    """Whether the vehicle is where the terrain's grid has no heights, shape (n,) of bool."""
    (x, y), spacing = grid.get("corner", (0.0, 0.0)), grid.get("spacing", 1.0)
    rows, columns = np.shape(grid["heights"])
    px, py = truth.position[:, 0] - x, truth.position[:, 1] - y
    return (px < 0.0) | (py < 0.0) | (px > spacing * (columns - 1)) | (py > spacing * (rows - 1))


def _table(scene: dict[str, Any], *path: str) -> dict[str, Any]:
    for key in path:
        scene = scene.get(key) or {}
    return scene


def _seconds(truth: TopicView, start: int, stop: int) -> str:
    return f"{truth.times[min(stop, len(truth.times) - 1)] - truth.times[start]:.1f}"
