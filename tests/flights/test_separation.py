"""Separation of vehicles at known distances."""

import numpy as np
import pytest

from lapwing.flights.separation import least_over_time, nearest


class Truth:
    """Return a straight path."""

    def __init__(self, start, velocity, n=11):
        self.times = np.arange(n) * 0.1
        self.position = np.array(start) + self.times[:, None] * np.array(velocity)

    def __len__(self):
        return len(self.times)


def test_passing_vehicles_are_nearest_side_by_side():
    truths = {
        "a": Truth((0.0, 0.0, 0.0), (2.0, 0.0, 0.0)),
        "b": Truth((1.0, 3.0, 0.0), (0.0, 0.0, 0.0)),
        "far": Truth((0.0, 90.0, 0.0), (0.0, 0.0, 0.0), n=6),  # shorter log
    }
    result = nearest(truths)
    assert (result.vehicles, result.distance, result.time) == (("a", "b"), pytest.approx(3.0), pytest.approx(0.5))
    assert str(result) == "Nearest: a and b, 3.00 m apart at 0.50 s"
    assert least_over_time(truths) == pytest.approx(np.hypot(3.0, 1.0 - 2.0 * np.arange(6) * 0.1))
