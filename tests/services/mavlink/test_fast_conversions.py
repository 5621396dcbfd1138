"""Fast conversions for telemetry against the exact ones."""

import math
import random

import pytest

from lapwing.dynamics.geodesy import Home
from lapwing.dynamics.lie.quaternion import Quaternion, to_roll_pitch_yaw
from lapwing.services.common.mavlink.frames import from_euler
from lapwing.services.common.mavlink.geo_coordinates import enu_to_geodetic
from lapwing.services.mavlink.fast_conversions import angles, geodetic


@pytest.mark.parametrize("seed", range(50))
def test_fast_geodetic_agrees_within_round_off(seed):
    chance = random.Random(seed)
    home = Home(chance.uniform(-89.0, 89.0), chance.uniform(-180.0, 180.0), chance.uniform(-400.0, 8000.0))
    place = chance.uniform(-2e4, 2e4), chance.uniform(-2e4, 2e4), chance.uniform(-100.0, 5e3)
    latitude, longitude, height = geodetic(home, place)
    exact = enu_to_geodetic(home, place)
    assert latitude == pytest.approx(exact[0], abs=1e-12)
    assert math.remainder(longitude - exact[1], 360.0) == pytest.approx(0.0, abs=1e-10)
    assert height == pytest.approx(exact[2], abs=1e-7)


@pytest.mark.parametrize("seed", range(50))
def test_fast_angles_agree_within_round_off(seed):
    chance = random.Random(seed)
    q = from_euler(chance.uniform(-3.0, 3.0), chance.uniform(-1.5, 1.5), chance.uniform(-3.0, 3.0))
    assert angles(q) == pytest.approx(to_roll_pitch_yaw(Quaternion(*q)), abs=1e-12)
