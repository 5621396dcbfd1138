"""Errors of known offsets."""

import numpy as np
import pytest

from studies import tracking


def test_angles_are_taken_the_short_way_round():
    reference, attitude = np.zeros((3, 6)), np.zeros((3, 3))
    reference[:, 5] = (0.1, 3.0, -3.0)
    attitude[:, 2] = (0.3, -3.0 - 4.0 * np.pi, 3.0)
    reference[:, 0] = (1.0, 2.0, 3.0)
    found = tracking.errors(reference, np.zeros((3, 3)), attitude, np.array([True, True, True]))
    assert found[:, 5] == pytest.approx([-0.2, 6.0 - 2.0 * np.pi, 2.0 * np.pi - 6.0])
    assert found[:, 0].tolist() == [1.0, 2.0, 3.0]
    assert len(tracking.errors(reference, np.zeros((3, 3)), attitude, np.array([True, False, True]))) == 2
