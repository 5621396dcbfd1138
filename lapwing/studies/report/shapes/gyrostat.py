"""A satellite: the box that has its moments of inertia, and its axes."""

import numpy as np

from lapwing.studies.flight_data import FlightData
from lapwing.studies.report.motion_3d import Motion, Stroke, of_truth
from lapwing.studies.report.shapes._outlines import box
from lapwing.studies.report.style import AXIS_COLOURS

MODELS = ("gyrostat",)
SIZE = 1.0  # [m] of the longest edge: its mass, and so its size, is not told


def draw(flight: FlightData) -> Motion | None:
    """A homogeneous box; its edges a, b, c follow from the moments J: 12 J_x = m (b^2 + c^2) and so on."""
    inertia = np.array(flight.origin.scene["gyrostat"]["inertia"], float)
    squares = (inertia.sum() / 2.0 - inertia).clip(min=1e-3 * inertia.max())
    edges = SIZE * np.sqrt(squares / squares.max())
    axes = [
        Stroke(np.array([np.zeros(3), 0.8 * SIZE * axis]), colour, 5.0)
        for axis, colour in zip(np.eye(3), AXIS_COLOURS, strict=True)
    ]
    return Motion((of_truth(flight, (Stroke(box(*edges)), *axes)),))
