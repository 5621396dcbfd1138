"""Validity warnings: vortex ring state, motor currents, edge of the terrain grid, distance from home."""

from typing import Any, NamedTuple

import numpy as np

from lapwing.flights.saturation import intervals, percent
from lapwing.flights.topic_view import TopicView

SHORTEST = 0.5  # [s] total time below which a warning is suppressed, except for currents
# Vortex ring state, in units of the induced velocity in hover: range of the descent rate, and largest speed across the
# rotor axis (after Leishman, Principles of Helicopter Aerodynamics, section 2.13)
SLOWEST_DESCENT, FASTEST_DESCENT, FASTEST_ACROSS = 0.5, 1.5, 1.0
FARTHEST = 1e5  # [m] from home, range of `height_above_home`


class ValidityWarning(NamedTuple):
    """Part of a flight in which a model is used outside its range."""

    start: float  # [s] of the first time
    text: str


def validity_warnings(truth: TopicView, scene: dict[str, Any]) -> list[ValidityWarning]:
    """Return one warning for each model that is used outside its range, for 0.5 s or more or with too high a current.

    Args:
        truth: true state.
        scene: tables of the scene.
    """
    warnings = []
    diameter = _table(scene, "airframe", "propeller").get("diameter")
    if diameter and {"rotor_thrust", "air_density", "wind"} <= set(truth.fields):
        in_ring = in_vortex_ring(truth, diameter)
        warnings += _warning(truth, in_ring, "descent in vortex ring state", "the thrust is uncertain")
    if "dc_motor" not in _table(scene, "effects") and {"motor_voltage", "rotor_speed"} <= set(truth.fields):
        warnings += _unlimited_current(truth, scene)
    grid = _table(scene, "environment", "terrain", "grid")
    if grid.get("heights"):
        text = "the ground is assumed level across the edge"
        warnings += _warning(truth, off_the_grid(truth, grid), "beyond the edge of the terrain grid", text)
    far = np.hypot(*truth.position[:, :2].T) > FARTHEST
    text = "heights of barometer and GPS differ by more than 0.1 m"
    return warnings + _warning(truth, far, "more than 100 km from home", text)


def _unlimited_current(truth: TopicView, scene: dict[str, Any]) -> list[ValidityWarning]:
    """Return the warning on winding currents above the motor's rated peak, which only `dc_motor` limits."""
    motor = _table(scene, "airframe", "motor")
    limit = motor.get("peak_current")
    if limit is None:
        return []
    current = np.where(truth.ground_contact[:, None], 0.0, winding_current(truth, motor))
    over = np.flatnonzero((current > limit).any(axis=1))
    text = f"motors take up to {current.max(initial=0.0):.3g} A, rated {limit:g} A; add effect dc_motor"
    return [ValidityWarning(float(truth.times[k]), text) for k in over[:1]]  # one line of a terminal of 80 columns


def winding_current(truth: TopicView, motor: dict[str, Any]) -> np.ndarray:
    """Return the current [A] of each motor by voltage and back-EMF, shape (n, motors) (theory, eq. (2.9)).

    Args:
        truth: true state, n messages.
        motor: table [motor] of the airframe.
    """
    constant = 30.0 / (np.pi * motor["speed_constant"] * motor["gear_ratio"])  # [V s/rad] at the rotor
    resistance = motor["resistance"] + motor.get("esc_resistance", 0.0)
    return (truth.motor_voltage - constant * truth.rotor_speed) / resistance


def _warning(truth: TopicView, where: np.ndarray, name: str, consequence: str) -> list[ValidityWarning]:
    """Return a warning on the times of `where`, or [] if they last less than `SHORTEST` in total."""
    step = np.diff(truth.times, append=truth.times[-1])
    seconds, flight = float(step[where].sum()), float(step[~truth.ground_contact].sum())
    if seconds < SHORTEST or not where.any():
        return []
    result = intervals(where, truth.times)
    times = f" ({len(result)} times)" if len(result) > 1 else ""
    share = percent(min(1.0, seconds / max(flight, 1e-9)))
    text = f"{name} for {seconds:.1f} s{times}, {share} of the time in the air: {consequence}"
    return [ValidityWarning(float(truth.times[result[0][0]]), text)]


def in_vortex_ring(truth: TopicView, diameter: float) -> np.ndarray:
    """Return True where the rotors descend into their own wake, shape (n,).

    Args:
        truth: true state, n messages.
        diameter: diameter of the rotors [m].
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
    """Return True where the vehicle is beyond the edge of the terrain grid, shape (n,)."""
    (x, y), spacing = grid.get("corner", (0.0, 0.0)), grid.get("spacing", 1.0)
    rows, columns = np.shape(grid["heights"])
    px, py = truth.position[:, 0] - x, truth.position[:, 1] - y
    return (px < 0.0) | (py < 0.0) | (px > spacing * (columns - 1)) | (py > spacing * (rows - 1))


def _table(scene: dict[str, Any], *path: str) -> dict[str, Any]:
    for key in path:
        scene = scene.get(key) or {}
    return scene
