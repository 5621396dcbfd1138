"""Resting pose on level ground, on a slope and between bumps."""

import math

import numpy as np
import pytest

from lapwing.dynamics.lie.quaternion import NO_ROTATION, rotation_matrix
from lapwing.dynamics.terrain import LEVEL, relief, surface
from lapwing.dynamics.vehicles.airframe import load_airframe
from lapwing.dynamics.vehicles.ground_equilibrium import resting_pose

DRONE = load_airframe("lapwing/scenes/vehicles/delivery_drone.toml")
FEET = DRONE.contact.feet


def clearances(feet, ground=LEVEL):
    position, attitude = resting_pose(feet, ground)
    R = np.reshape(rotation_matrix(attitude), (3, 3))
    places = np.array(position) + np.array(feet) @ R.T
    return R, np.array([z - surface(ground, x, y)[0] for x, y, z in places])


def test_resting_pose_on_level_ground_is_exact():
    assert resting_pose(FEET) == ((0.0, 0.0, 0.35), NO_ROTATION)
    assert resting_pose([]) == ((0.0, 0.0, 0.0), NO_ROTATION)


@pytest.mark.parametrize("slope", [(0.1, 0.0), (0.0, -0.2), (0.5, 0.5), (-0.9, 0.1)])
def test_on_slope_every_foot_touches(slope):
    plane = relief(slope=slope)
    R, heights = clearances(FEET, plane)
    assert abs(heights).max() < 1e-12
    assert R[:, 2] == pytest.approx(surface(plane, 3.0, 4.0)[1], abs=1e-12)
    assert math.atan2(R[1, 0], R[0, 0]) == pytest.approx(0.0, abs=1e-12)  # heading
    assert resting_pose(FEET, plane)[0][:2] == (0.0, 0.0)


UNEVEN = [(0.2, 0.2, -0.30), (-0.2, 0.2, -0.35), (-0.2, -0.2, -0.35), (0.25, -0.2, -0.32)]


@pytest.mark.parametrize("slope", [(0.0, 0.0), (0.1, 0.0), (-0.2, 0.3)])
def test_three_uneven_feet_around_centre_of_mass_touch(slope):
    R, heights = clearances(UNEVEN, relief(slope=slope))
    assert heights.min() > -1e-12
    assert np.sort(heights)[2] < 1e-12
    touching = (np.array(UNEVEN) @ R.T)[np.argsort(heights)[:3], :2]
    shares = np.linalg.solve(np.vstack([touching.T, np.ones(3)]), [0.0, 0.0, 1.0])
    assert shares.min() >= -1e-9
    assert math.atan2(R[1, 0], R[0, 0]) == pytest.approx(0.0, abs=1e-12)


def test_tilt_on_three_unequal_feet_follows_closed_form():
    R, heights = clearances([(0.2, 0.0, -0.30), (-0.2, 0.1, -0.35), (-0.2, -0.1, -0.35)])
    assert abs(heights).max() < 1e-12
    assert math.atan2(-R[2, 0], R[2, 2]) == pytest.approx(math.atan2(0.05, 0.4), abs=1e-12)  # nose down


def test_feet_off_centre_of_mass_leave_vehicle_level():
    (x, y, z), attitude = resting_pose([(0.1, 0.1, -0.3), (0.2, 0.1, -0.35), (0.2, -0.1, -0.35)])
    assert (x, y, z, attitude) == (0.0, 0.0, 0.35, NO_ROTATION)


@pytest.mark.parametrize("slope", [(0.0, 0.0), (0.1, -0.05)])
def test_between_bumps_three_feet_touch_and_none_is_below(slope):
    R, heights = clearances(FEET, relief(slope=slope, bump_height=0.02, bump_length=1.3))
    assert heights.min() > -1e-12
    assert np.sort(heights)[2] < 1e-9
    assert R[2, 2] > 0.9
