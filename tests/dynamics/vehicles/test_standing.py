"""How a vehicle stands: level, on a slope, between bumps."""

import math

import numpy as np
import pytest

from dynamics.effects._contact_parameters import GroundContact
from dynamics.effects._ground import surface
from dynamics.lie.quaternion import NO_ROTATION, rotation_matrix
from dynamics.vehicles.airframe import load_airframe
from dynamics.vehicles.standing import standing_pose

DRONE = load_airframe("scenes/vehicles/delivery_drone.toml")
FEET = DRONE.contact.feet


def ground(**table):
    return GroundContact.from_scene(table, DRONE).ground


def clearances(feet, ground):
    position, attitude = standing_pose(feet, ground)
    R = np.reshape(rotation_matrix(attitude), (3, 3))
    places = np.array(position) + np.array(feet) @ R.T
    return R, np.array([z - surface(ground, x, y)[0] for x, y, z in places])


@pytest.mark.parametrize("level", [None, ground(), ground(slope=[0.0, 0.0])])
def test_on_level_ground_it_is_not_turned_by_a_bit(level):
    assert standing_pose(FEET, level) == ((0.0, 0.0, 0.35), NO_ROTATION)
    uneven = [(0.2, 0.0, -0.3), (-0.2, 0.1, -0.35), (-0.2, -0.1, -0.35)]
    assert standing_pose(uneven, level) == ((0.0, 0.0, 0.35), NO_ROTATION)
    assert standing_pose([], level) == ((0.0, 0.0, 0.0), NO_ROTATION)


@pytest.mark.parametrize("slope", [(0.1, 0.0), (0.0, -0.2), (0.5, 0.5), (-0.9, 0.1)])
def test_on_a_slope_every_foot_touches(slope):
    plane = ground(slope=list(slope))
    R, heights = clearances(FEET, plane)
    assert abs(heights).max() < 1e-12
    assert R[:, 2] == pytest.approx(plane.normal, abs=1e-12)
    assert math.atan2(R[1, 0], R[0, 0]) == pytest.approx(0.0, abs=1e-12)  # heading
    assert standing_pose(FEET, plane)[0][:2] == (0.0, 0.0)


def test_of_uneven_feet_the_lowest_touches():
    uneven = [(0.2, 0.2, -0.30), (-0.2, 0.2, -0.35), (-0.2, -0.2, -0.35), (0.2, -0.2, -0.32)]
    plane = ground(slope=[0.1, 0.0])
    R, heights = clearances(uneven, plane)
    assert R[:, 2] == pytest.approx(plane.normal, abs=1e-12)
    assert heights.min() == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("slope", [(0.0, 0.0), (0.1, -0.05)])
def test_between_bumps_three_feet_touch_and_none_is_below(slope):
    R, heights = clearances(FEET, ground(slope=list(slope), bump_height=0.02, bump_length=1.3))
    assert heights.min() > -1e-12
    assert np.sort(heights)[2] < 1e-9
    assert R[2, 2] > 0.9
