"""Trail of a vehicle that is flying: a few lines, of which the last one grows."""

from collections import deque
from typing import Any

import numpy as np

from lapwing.studies.flight_data import FlightData
from lapwing.studies.view3d.stage import Vehicle

RATE = 4  # points of a step
POINTS = 400  # of a line: all of them are sent again when it grows
LINES = 30  # of a trail, each a draw call; the oldest are removed


class LiveTrail:
    """Lines of one vehicle."""

    def __init__(self, vehicle: Vehicle, most: float):
        """Create an empty trail; `most` is the error [m] at the end of its colours."""
        self._vehicle, self._most, self._begun = vehicle, most, 0
        self._lines: deque[Any] = deque()
        self._points, self._errors = np.empty((0, 3)), np.empty(0)

    def extend(self, step: FlightData) -> None:
        """Append the path of a step."""
        rows = np.unique(np.linspace(0, len(step.truth) - 1, RATE + 1).round().astype(int))
        path = step.truth.position[rows]
        error = np.full(len(rows), np.nan)
        if len(step.reference):
            error = np.linalg.norm(path - step.reference[np.minimum(rows, len(step.reference) - 1), :3], axis=1)
        begins = not self._lines or len(self._points) > POINTS
        remaining = slice(-1, None) if begins else slice(None)  # a line begins where the one before ends
        self._points = np.concatenate([self._points[remaining], path])
        self._errors = np.concatenate([self._errors[remaining], error])
        if len(self._points) < 2:
            return
        known = None if np.isnan(self._errors).any() else self._errors
        self._begun += begins
        before = None if begins else self._lines[-1]
        line = self._vehicle.trail(self._points, known, self._most, f"trail/{self._begun}", before)
        if begins:
            self._lines.append(line)
        if len(self._lines) > LINES:
            self._lines.popleft().remove()
