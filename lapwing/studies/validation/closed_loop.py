"""Closed loop: the scene's vehicle and autopilot fly the setpoints of a recording.

The prediction windows judge the plant alone. This flight judges plant and autopilot together, from take-off to the end
of the recorded setpoints, without any correction by what was measured.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lapwing.cosim.scene import Overrides, Scene
from lapwing.messages.topics import TRUTH
from lapwing.services.scene_resolver import load_one
from lapwing.studies import simulate
from lapwing.studies.flight_data import FlightData
from lapwing.studies.flight_import.recording import LOWEST, Recording

SHORTEST = 3.0  # [s] of setpoints that are worth flying
TABLE_STEP = 0.04  # [s] between two points of the trajectory
CLIMB, APPROACH, HOVER = 3.0, 3.0, 2.0  # [s] before the recorded setpoints begin
RESTING_HEIGHT = 0.15  # [m] of the markers over the ground, below which a flight begins on it
PHASE = "recorded setpoints"


class ClosedLoop(NamedTuple):
    """One recorded flight and the simulated flight of its setpoints; n samples."""

    name: str
    time: np.ndarray  # [s] from the first setpoint flown, shape (n,)
    setpoint: np.ndarray  # [m] world, shape (n, 3)
    recorded: np.ndarray  # [m] world, shape (n, 3)
    simulated: np.ndarray  # [m] world, shape (n, 3)

    @property
    def difference(self) -> float:
        """Mean absolute difference between simulated and recorded position [m], mean over axes."""
        return float(np.abs(self.simulated - self.recorded).mean())

    def tracking_error(self, position: np.ndarray) -> float:
        """Mean absolute error [m] of a position against the setpoints, mean over axes."""
        return float(np.abs(position - self.setpoint).mean())


def fly_setpoints(scene: Scene | str | Path, flight: Recording, overrides: Overrides = ()) -> ClosedLoop | None:
    """Fly the longest airborne stretch of a recording's setpoints, or return None if it has none of `SHORTEST`.

    Args:
        scene: vehicle, autopilot and environment; its trajectory is replaced.
        flight: with setpoints.
        overrides: of the scene.
    """
    span = _airborne(flight)
    if (span.stop - span.start) * flight.interval < SHORTEST:
        return None
    ground = flight.position[np.flatnonzero(flight.valid)[0]]
    floor = np.array([0.0, 0.0, ground[2] if ground[2] < RESTING_HEIGHT else 0.0])
    desired = flight.setpoint[span, :3]
    points = desired - floor
    length = (len(points) - 1) * flight.interval
    lead = CLIMB + APPROACH + HOVER
    own: dict[str, Any] = {"trajectory.phase": _phases(points, flight.interval), "run.duration": lead + length}
    simulation: FlightData = simulate.fly(load_one(load_one(scene, overrides), own), only=(TRUTH,))
    time = np.arange(len(points)) * flight.interval
    at, truth = simulation.times("ground_truth"), np.asarray(simulation.truth.position)
    inside = lead + time <= at[-1]  # a flight that diverges ends early
    simulated = np.column_stack([np.interp(lead + time[inside], at, c) for c in truth.T]) + floor
    return ClosedLoop(flight.name, time[inside], desired[inside], flight.position[span][inside], simulated)


def _airborne(flight: Recording) -> slice:
    """Return the longest stretch in the air with setpoints."""
    if len(flight.setpoint) != len(flight):
        return slice(0, 0)
    sound = flight.valid & (flight.position[:, 2] > LOWEST) & (flight.setpoint[:, 2] > LOWEST)
    edges = np.flatnonzero(np.diff(np.r_[0, sound.astype(int), 0])).reshape(-1, 2)
    if not len(edges):
        return slice(0, 0)
    begin, end = edges[np.argmax(edges[:, 1] - edges[:, 0])]
    return slice(int(begin), int(end))


def _phases(points: np.ndarray, interval: float) -> Sequence[dict[str, Any]]:
    """Return phases that take off, go to the first setpoint, and follow the others."""
    first = [float(v) for v in points[0]]
    stride = max(1, round(TABLE_STEP / interval))
    chosen = np.unique(np.r_[np.arange(0, len(points), stride), len(points) - 1])

    def table(column: int) -> dict[str, Any]:
        rows = [[float(k * interval), float(points[k, column])] for k in chosen]
        return {"kind": "table", "points": rows}

    go = {c: {"kind": "minimum_jerk", "to": first[k], "duration": APPROACH} for k, c in enumerate("xy")}
    return [
        {"name": "climb", "z": {"kind": "minimum_jerk", "to": first[2], "duration": CLIMB}},
        {"name": "approach", **go},
        {"name": "hover", "duration": HOVER},
        {"name": PHASE, **{c: table(k) for k, c in enumerate("xyz")}},
    ]
