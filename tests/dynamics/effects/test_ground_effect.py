import numpy as np
import pytest
from effects_helpers import NO_FACTORS

from lapwing.dynamics import effects
from lapwing.dynamics.effects.ground_effect import gain, ground_effect, high

pytestmark = pytest.mark.usefixtures("uncompiled")

RADIUS = 0.2794


@pytest.mark.parametrize(
    ("height", "expected"), [(0.5, 4 / 3), (1.0, 16 / 15), (2.0, 64 / 63), (0.1, 4 / 3), (9.0, 1.0)]
)
def test_law_of_cheeseman_and_bennett(height, expected):
    assert gain(height) == pytest.approx(expected, rel=1e-14)


def test_gain_falls_with_height_without_step():
    values = np.array([gain(z) for z in np.linspace(0.5, 8.5, 4001)])
    assert (np.diff(values) <= 0).all()
    assert np.abs(np.diff(values[2000:])).max() < 1e-5


def test_lower_rotor_gains_more(drone, situation):
    (e,) = effects.from_scene({"ground_effect": {}}, drone)
    level = ground_effect.py_func(e, (), situation(position=(0, 0, 2 * RADIUS)), NO_FACTORS)
    assert level.thrust == pytest.approx([64 / 63] * 4)
    assert level.torque == NO_FACTORS.torque
    rolled = ground_effect.py_func(e, (), situation(position=(0, 0, 2 * RADIUS), turn=(0.2, 0, 0)), NO_FACTORS)
    assert rolled.thrust[2] > 64 / 63 > rolled.thrust[0]  # rolled to the right: rotors 3 and 4 are low


def test_ground_effect_sleeps_only_without_influence(drone, situation):
    (e,) = effects.from_scene({"ground_effect": {}}, drone)
    motion = situation(position=(0, 0, e.highest + 0.01), velocity=(0, 0, -4)).motion
    assert high.py_func(e, motion, 0.001)
    assert not high.py_func(e, motion, 0.01)
    s = situation(position=(0, 0, e.highest), turn=(1.2, 0.5, 0))
    assert ground_effect.py_func(e, (), s, NO_FACTORS).thrust == (1.0,) * 4
