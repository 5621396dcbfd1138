"""The vehicle starts in equilibrium for any ground and feet: no acceleration, no motion."""

import numpy as np
import pytest

import lapwing

pytestmark = pytest.mark.long

STANDING = {"autopilot.accept_commands": True, "autopilot.follow_trajectory": False, "run.duration": 0.2}  # never armed
UNEVEN = [[0.20, 0.25, -0.30], [-0.20, 0.20, -0.35], [-0.20, -0.25, -0.36], [0.25, -0.25, -0.32]]
CASES = {
    "level": {},
    "unequal heights and places": {"airframe.contact.feet": UNEVEN},
    "slope": {"environment.terrain.slope": [0.1, -0.2]},
    "unequal feet on a slope": {"airframe.contact.feet": UNEVEN, "environment.terrain.slope": [-0.2, 0.1]},
    "bumps": {"environment.terrain.bump_height": 0.02, "environment.terrain.bump_length": 1.3},
    "soft ground": {"effects.ground_contact.stiffness": 1e4, "airframe.contact.feet": UNEVEN},
    "heavier": {"vehicle.mass": 14.0},
}


@pytest.mark.parametrize("overrides", CASES.values(), ids=CASES)
def test_vehicle_is_in_equilibrium_at_first_tick(overrides):
    truth = lapwing.fly("hover", {**STANDING, **overrides}).truth
    assert abs(truth.acceleration).max() < 1e-6
    assert abs(truth.angular_velocity).max() < 1e-8
    assert np.ptp(truth.position, axis=0).max() < 1e-9
    assert truth.ground_contact.all()


def test_vehicle_slides_on_steep_ground():
    truth = lapwing.fly("hover", {**STANDING, "environment.terrain.slope": [0.7, 0.0]}).truth
    assert truth.velocity[-1, 0] < -0.1
    assert np.ptp(truth.attitude, axis=0).max() < 0.1
