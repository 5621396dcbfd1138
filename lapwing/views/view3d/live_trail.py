"""Trail of a vehicle in a live view: several lines, the last of which grows."""

from collections import deque
from typing import Any

import numpy as np

from lapwing.flights.flight_data import FlightData
from lapwing.views.view3d.stage import Vehicle

RATE = 4  # points per step
POINTS = 400  # largest number of points of a line, which is sent completely when it grows
LINES = 30  # largest number of lines of a trail, each a draw call; the oldest are removed


class LiveTrail:
    """Trail of one vehicle."""

    def __init__(self, vehicle: Vehicle, most: float):
        """Create an empty trail; `most` is the error [m] at the end of the colour scale."""
        self._vehicle, self._most, self._count = vehicle, most, 0
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
        remaining = slice(-1, None) if begins else slice(None)  # a line starts at the end of the previous one
        self._points = np.concatenate([self._points[remaining], path])
        self._errors = np.concatenate([self._errors[remaining], error])
        if len(self._points) < 2:
            return
        errors = None if np.isnan(self._errors).any() else self._errors
        self._count += begins
        before = None if begins else self._lines[-1]
        line = self._vehicle.trail(self._points, errors, self._most, f"trail/{self._count}", before)
        if begins:
            self._lines.append(line)
        if len(self._lines) > LINES:
            self._lines.popleft().remove()
