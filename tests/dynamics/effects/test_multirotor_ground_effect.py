"""Multirotor ground effect against the published law for quadrotors, closed forms for partial ground, and limits."""

import math

import numpy as np
import pytest
from effects_helpers import NO_FACTORS

from lapwing.dynamics import effects
from lapwing.dynamics.effects.multirotor_ground_effect import high, multirotor_ground_effect
from lapwing.dynamics.environment import STANDARD
from lapwing.dynamics.terrain import relief

pytestmark = pytest.mark.usefixtures("uncompiled")

R, D = 0.2794, 2 * 0.35171491  # radius, distance of adjacent axes [m]
B = math.sqrt(2) * D
TOP = 100.0  # [m] of a table in the air: the ground below it is out of reach


def make(drone, terrain=None, **table):
    (e,) = effects.from_scene({"multirotor_ground_effect": table}, drone)
    return e if terrain is None else e.in_environment(STANDARD._replace(terrain=terrain))


def thrust(e, s):
    return np.array(multirotor_ground_effect.py_func(e, (), s, NO_FACTORS).thrust)


def published(z, fountain):
    """Return the ratio of Sanchez-Cuevas et al., eq. (4), as printed."""
    images = (R / (4 * z)) ** 2 + R**2 * z / (D**2 + 4 * z**2) ** 1.5 + 0.5 * R**2 * z / (2 * D**2 + 4 * z**2) ** 1.5
    return 1 / (1 - images - 2 * R**2 * z * fountain / (B**2 + 4 * z**2) ** 1.5)


@pytest.mark.parametrize("fountain", [0.0, 2.0])
def test_level_quadrotor_follows_published_law(drone, situation, fountain):
    e = make(drone, fountain=fountain)
    for radii in np.linspace(0.5, 8.0, 31):
        gains = thrust(e, situation(position=(0, 0, radii * R)))
        assert gains == pytest.approx([published(radii * R, fountain)] * 4, rel=1e-12)


def test_gain_exceeds_that_of_separate_rotors(drone, situation):
    gain = thrust(make(drone), situation(position=(0, 0, 2 * R)))[0]
    assert gain > 1.05 > 64 / 63


def test_gain_fades_without_step(drone, situation):
    e = make(drone)
    gains = np.array([thrust(e, situation(position=(0, 0, z * R)))[0] for z in np.linspace(0.4, 12.5, 1211)])
    assert (np.diff(gains) <= 1e-15).all()
    assert np.abs(np.diff(gains[700:])).max() < 1e-4
    assert gains[-1] == 1.0


def table(edge, width=100.0):
    """Return a level surface at TOP where world x is below `edge`."""
    return relief(boxes=[(edge - 50.0, 0.0, 100.0, width, 0.0, TOP)])


def test_only_rotors_over_table_gain(drone, situation):
    """Rotors over the table see their image and one neighbour's, and a third of the fountain."""
    e = make(drone, table(0.0))
    z = R
    gains = thrust(e, situation(position=(0, 0, TOP + z)))
    images = (R / (4 * z)) ** 2 + 0.5 * R**2 * z / (D**2 + 4 * z**2) ** 1.5
    expected = 1 / (1 - images - 2 * R**2 * z * 2.0 / (B**2 + 4 * z**2) ** 1.5 / 3)
    assert gains == pytest.approx([1.0, expected, expected, 1.0], abs=1e-4)


def test_single_rotor_over_table_follows_cheeseman_and_bennett(drone, situation):
    e = make(drone, table(-0.2, width=0.6), fountain=2.0)
    s = situation(position=(0, 0, TOP + R), turn=(0, 0, math.pi / 4))  # one rotor points back
    gains = thrust(e, s)
    assert sorted(gains)[-1] == pytest.approx(16 / 15, rel=1e-12)
    assert sorted(gains)[:3] == pytest.approx([1.0] * 3, abs=1e-3)


def test_disc_over_edge_gains_by_its_area(drone, situation):
    """Eight points of equal area approximate a circle's segment; the theory lists the largest difference."""
    largest = 0.0
    for inside in np.linspace(-1.2, 1.2, 49):  # radii from the edge to the axis, positive over the table
        s = situation(position=(0, 0, TOP + R), turn=(0, 0, math.pi / 4))
        e = make(drone, table(-B / 2 + inside * R), fountain=0.0)
        cancelled = max(1.0 - 1.0 / thrust(e, s)) * 16.0
        u = min(max(inside, -1.0), 1.0)
        area = 1.0 - (math.acos(u) - u * math.sqrt(1.0 - u * u)) / math.pi
        largest = max(largest, abs(cancelled - area))
    assert largest < 0.13


def test_forward_flight_reduces_gain(drone, situation):
    """Cheeseman and Bennett: the cancelled share is divided by 1 + (V / v)^2, v of forward flight (Glauert)."""
    e = make(drone, fountain=0.0)
    hover = e.flow * 300.0
    still = 1.0 - 1.0 / thrust(e, situation(position=(0, 0, R)))[0]
    for speed in (2.0, 6.0, 15.0):
        v = math.sqrt(math.sqrt(speed**4 / 4 + hover**4) - speed**2 / 2)
        moving = 1.0 - 1.0 / thrust(e, situation(position=(0, 0, R), velocity=(speed, 0, 0)))[0]
        assert moving == pytest.approx(still / (1.0 + (speed / v) ** 2), rel=1e-9)


def test_effect_sleeps_only_without_influence(drone, situation):
    e = make(drone)
    assert high.py_func(e, situation(position=(0, 0, e.highest + 0.01), velocity=(0, 0, -4)).motion, 0.001)
    assert not high.py_func(e, situation(position=(0, 0, e.highest - 0.01)).motion, 0.001)
    assert thrust(e, situation(position=(0, 0, e.highest), turn=(1.2, 0.5, 0))) == pytest.approx([1.0] * 4, abs=0)


def test_excludes_ground_effect_of_separate_rotors(drone):
    with pytest.raises(ValueError, match=r"cannot be combined with effects.ground_effect, also a ground effect model"):
        effects.from_scene({"ground_effect": {}, "multirotor_ground_effect": {}}, drone)
