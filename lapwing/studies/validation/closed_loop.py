"""Closed-loop simulation of the setpoints of a recording by the scene's vehicle and autopilot.

Prediction windows test the plant alone. This simulation tests plant and autopilot together, from take-off to the end of
the recorded setpoints, without corrections by measurements.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lapwing.cosim.scene import Overrides, Scene
from lapwing.flights.flight_data import FlightData
from lapwing.flights.log_import.recording import LOWEST, Recording
from lapwing.messages.topics import TRUTH
from lapwing.services.scene_resolver import load_one
from lapwing.studies import simulate

SHORTEST = 3.0  # [s] minimum duration of the setpoints
TABLE_STEP = 0.04  # [s] between two points of the trajectory
CLIMB, APPROACH, HOVER = 3.0, 3.0, 2.0  # [s] durations of the phases before the recorded setpoints
RESTING_HEIGHT = 0.15  # [m] initial height of the markers below which the flight starts on the ground
PHASE = "recorded setpoints"


class ClosedLoop(NamedTuple):
    """One recorded flight and the simulated flight of its setpoints; n samples."""

    name: str
    time: np.ndarray  # [s] since the first simulated setpoint, shape (n,)
    setpoint: np.ndarray  # [m] world, shape (n, 3)
    recorded: np.ndarray  # [m] world, shape (n, 3)
    simulated: np.ndarray  # [m] world, shape (n, 3)

    @property
    def difference(self) -> float:
        """Mean absolute difference between simulated and recorded position [m], mean over axes."""
        return float(np.abs(self.simulated - self.recorded).mean())

    def tracking_error(self, position: np.ndarray) -> float:
        """Return the mean absolute error [m] of a position, shape (n, 3), from the setpoints, mean over axes."""
        return float(np.abs(position - self.setpoint).mean())


def fly_setpoints(scene: Scene | str | Path, flight: Recording, overrides: Overrides = ()) -> ClosedLoop | None:
    """Simulate the longest airborne interval of a recording's setpoints. Return None if it is shorter than `SHORTEST`.

    Args:
        scene: vehicle, autopilot and environment; its trajectory is replaced.
        flight: recording with setpoints.
        overrides: overrides of the scene.
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
    simulated_time, truth = simulation.times("ground_truth"), np.asarray(simulation.truth.position)
    inside = lead + time <= simulated_time[-1]  # a diverging flight ends early
    simulated = np.column_stack([np.interp(lead + time[inside], simulated_time, c) for c in truth.T]) + floor
    return ClosedLoop(flight.name, time[inside], desired[inside], flight.position[span][inside], simulated)


def _airborne(flight: Recording) -> slice:
    """Return the rows of the longest interval in the air with setpoints."""
    if len(flight.setpoint) != len(flight):
        return slice(0, 0)
    airborne = flight.valid & (flight.position[:, 2] > LOWEST) & (flight.setpoint[:, 2] > LOWEST)
    edges = np.flatnonzero(np.diff(np.r_[0, airborne.astype(int), 0])).reshape(-1, 2)
    if not len(edges):
        return slice(0, 0)
    begin, end = edges[np.argmax(edges[:, 1] - edges[:, 0])]
    return slice(int(begin), int(end))


def _phases(points: np.ndarray, interval: float) -> Sequence[dict[str, Any]]:
    """Return phases for take-off, the flight to the first setpoint, and the following setpoints."""
    first = [float(v) for v in points[0]]
    stride = max(1, round(TABLE_STEP / interval))
    rows_used = np.unique(np.r_[np.arange(0, len(points), stride), len(points) - 1])

    def table(column: int) -> dict[str, Any]:
        rows = [[float(k * interval), float(points[k, column])] for k in rows_used]
        return {"kind": "table", "points": rows}

    approach = {c: {"kind": "minimum_jerk", "to": first[k], "duration": APPROACH} for k, c in enumerate("xy")}
    return [
        {"name": "climb", "z": {"kind": "minimum_jerk", "to": first[2], "duration": CLIMB}},
        {"name": "approach", **approach},
        {"name": "hover", "duration": HOVER},
        {"name": PHASE, **{c: table(k) for k, c in enumerate("xyz")}},
    ]
