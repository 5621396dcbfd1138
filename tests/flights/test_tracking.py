"""Errors of known offsets."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lapwing.flights import tracking


def test_roll_pitch_yaw_equal_scipy():
    some = Rotation.random(100, random_state=np.random.default_rng(3))
    result, expected = tracking.roll_pitch_yaw(some.as_quat()), some.as_euler("ZYX")[:, ::-1]
    assert result[:, :2] == pytest.approx(expected[:, :2], abs=1e-7)  # asin is steep near 90 degrees
    assert np.cos(result[:, 2] - expected[:, 2]) == pytest.approx(1.0)


def test_angle_differences_are_wrapped():
    reference, attitude = np.zeros((3, 6)), np.zeros((3, 3))
    reference[:, 5] = (0.1, 3.0, -3.0)
    attitude[:, 2] = (0.3, -3.0 - 4.0 * np.pi, 3.0)
    reference[:, 0] = (1.0, 2.0, 3.0)
    result = tracking.errors(reference, np.zeros((3, 3)), attitude, np.array([True, True, True]))
    assert result[:, 5] == pytest.approx([-0.2, 6.0 - 2.0 * np.pi, 2.0 * np.pi - 6.0])
    assert result[:, 0].tolist() == [1.0, 2.0, 3.0]
    assert len(tracking.errors(reference, np.zeros((3, 3)), attitude, np.array([True, False, True]))) == 2


def test_errors_are_bit_for_bit_those_of_numpy():
    random = np.random.default_rng(5)
    reference, position, attitude = (random.normal(size=(500, k)) * 9.0 for k in (6, 3, 3))
    armed = random.random(500) > 0.3
    turn = reference[:, 3:] - attitude
    turn -= tracking.TURN * np.round(turn / tracking.TURN)
    expected = np.column_stack([reference[:, :3] - position, turn])[armed]
    assert np.array_equal(tracking.errors(reference, position, attitude, armed), expected)
    assert np.array_equal(tracking.errors(reference, position.T.copy().T, attitude, armed), expected)  # other layout


def test_yaw_is_continuous_over_half_turn():
    yaw = np.linspace(0.0, 9.0, 50)
    xyzw = np.column_stack([np.zeros((50, 2)), np.sin(0.5 * yaw), np.cos(0.5 * yaw)])
    assert tracking.roll_pitch_yaw(xyzw)[:, 2] == pytest.approx(yaw)
    assert tracking.roll_pitch_yaw(xyzw[:17])[:, 2] == pytest.approx(yaw[:17])  # no jump
