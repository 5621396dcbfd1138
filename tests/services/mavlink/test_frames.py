"""Frames against explicit rotation matrices and compass directions."""

import math

import numpy as np
import pytest

from lapwing.dynamics.lie.quaternion import Quaternion, to_roll_pitch_yaw
from lapwing.services.common.mavlink.frames import saturate, swap_attitude, swap_body, swap_world, swap_yaw, wrap

C = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1.0]])
D = np.diag([1, -1, -1.0])


def matrix(q):
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def test_vector_permutations_equal_matrices():
    v = (1.0, 2.0, 3.0)
    np.testing.assert_array_equal(swap_world(v), C @ v)
    np.testing.assert_array_equal(swap_body(v), D @ v)


def test_attitude_is_product_of_matrices():
    for seed in range(20):
        q = np.random.default_rng(seed).normal(size=4)
        q /= np.linalg.norm(q)
        turned = swap_attitude(tuple(q))
        np.testing.assert_allclose(matrix(turned), C @ matrix(q) @ D, atol=1e-14)
        assert turned[0] >= 0.0
        np.testing.assert_allclose(matrix(swap_attitude(turned)), matrix(q), atol=1e-14)


def test_facing_east_is_heading_90_degrees():
    assert math.degrees(to_roll_pitch_yaw(Quaternion(*swap_attitude((1.0, 0.0, 0.0, 0.0))))[2]) == pytest.approx(90.0)
    assert math.degrees(swap_yaw(0.0)) == pytest.approx(90.0)
    assert swap_yaw(swap_yaw(0.3)) == pytest.approx(0.3)


def test_pitch_is_positive_nose_up_and_roll_right_side_down():
    up = swap_attitude((math.cos(-0.1), 0.0, math.sin(-0.1), 0.0))  # FLU: a turn about y to the left lifts by -0.2
    assert to_roll_pitch_yaw(Quaternion(*up))[1] == pytest.approx(0.2)
    right = swap_attitude((math.cos(0.1), math.sin(0.1), 0.0, 0.0))
    assert to_roll_pitch_yaw(Quaternion(*right))[0] == pytest.approx(0.2)


def test_angles_are_wrapped():
    assert wrap(3.5 * math.pi) == pytest.approx(-0.5 * math.pi)
    assert wrap(math.pi) == math.pi
    assert math.isnan(wrap(math.nan))
    assert math.isnan(wrap(math.inf))


def test_integers_saturate_at_limits_of_field():
    assert saturate(1.6, 8) == 2
    assert saturate(1e9, 16) == 32767
    assert saturate(-1e9, 16) == -32768
    assert saturate(-1.0, 16, unsigned=True) == 0
    assert saturate(math.nan, 16, unsigned=True) == 65535
    assert saturate(math.inf, 8, unknown=-1) == -1
