"""Ceiling effect against the published power ratio and an independent solution of the blade equations."""

import math

import numpy as np
import pytest
from effects_helpers import NO_FACTORS
from scipy.optimize import brentq

from lapwing.dynamics import effects
from lapwing.dynamics.effects.ceiling_effect import ceiling_effect, low

pytestmark = pytest.mark.usefixtures("uncompiled")

R = 0.2794  # [m]
CEILING = 20.0  # [m]


def make(drone, **table):
    (e,) = effects.from_scene({"ceiling_effect": {"height": CEILING, **table}}, drone)
    return e


def factors(e, s):
    return tuple(np.array(part) for part in ceiling_effect.py_func(e, (), s, NO_FACTORS))


def below(situation, radii, **how):
    return situation(position=(how.pop("x", 0.0), 0.0, CEILING - radii * R), **how)


@pytest.mark.parametrize("asymmetry", [1.0, 1.6])
def test_induced_power_follows_published_ratio(drone, situation, asymmetry):
    """Hsiao and Chirarattananon, eq. (6): P T^-1.5 falls by gamma = 1/2 + sqrt(1 + alpha / (8 delta^2)) / 2."""
    e = make(drone, asymmetry=asymmetry)
    for radii in np.linspace(0.25, 4.0, 16):
        thrust, torque = factors(e, below(situation, radii))
        power = 1.0 + (torque - 1.0) / e.induced  # the induced part, at the same rotor speed
        gamma = 0.5 + 0.5 * math.sqrt(1.0 + asymmetry / (8.0 * radii**2))
        assert thrust**1.5 / power == pytest.approx([gamma] * 4, rel=1e-12)


def test_thrust_at_equal_power_follows_published_factor(drone, situation):
    """Section V.C: thrust grows by gamma^(2/3) at the induced power without a ceiling, 7.4 % at half a radius."""
    e = make(drone)
    for radii, published in ((0.5, 1.074), (1.0, 1.020), (2.0, 1.005)):
        thrust, torque = factors(e, below(situation, radii))
        power = 1.0 + (torque[0] - 1.0) / e.induced
        assert thrust[0] / power ** (2.0 / 3.0) == pytest.approx(published, abs=5e-4)


def test_blades_and_flow_agree(drone, situation):
    e = make(drone)
    gamma = 0.5 + 0.5 * math.sqrt(1.0 + 1.0 / (8.0 * 0.4**2))
    expected = brentq(lambda t: t - (e.pitch - math.sqrt(t) / gamma) / (e.pitch - 1.0), 0.5, 2.0)
    assert factors(e, below(situation, 0.4))[0] == pytest.approx([expected] * 4, rel=1e-12)


def test_rotor_near_ceiling_gains_most(drone, situation):
    thrust, _ = factors(make(drone), below(situation, 2.0, turn=(0.2, 0, 0)))
    assert thrust[0] > 1.0
    assert thrust[0] > thrust[2]


def test_only_rotors_under_ceiling_gain(drone, situation):
    e = make(drone, centre=(5.0, 0.0), size=(10.0, 10.0))  # from x = 0
    thrust, torque = factors(e, below(situation, 0.5))
    assert thrust[1:3] == pytest.approx([1.0, 1.0])
    assert min(thrust[0], thrust[3]) > 1.02
    assert torque[1:3] == pytest.approx([1.0, 1.0])


def test_gain_has_no_step_at_edge_or_far_below(drone, situation):
    e = make(drone, centre=(5.0, 0.0), size=(10.0, 10.0))
    across = np.array([factors(e, below(situation, 0.5, x=x))[0][0] for x in np.linspace(-1.0, 1.0, 801)])
    assert np.abs(np.diff(across)).max() < 5e-4
    down = np.array([factors(e, below(situation, z, x=5.0))[0][0] for z in np.linspace(0.2, 9.0, 881)])
    assert (np.diff(down) <= 1e-15).all()
    assert down[-1] == 1.0


def test_effect_sleeps_only_out_of_reach(drone, situation):
    e = make(drone)
    assert low.py_func(e, situation(position=(0, 0, CEILING - e.reach - 0.1)).motion, 0.001)
    assert not low.py_func(e, situation(position=(0, 0, CEILING - e.reach + 0.1)).motion, 0.001)
    turned = situation(position=(0, 0, CEILING - e.reach), turn=(1.5, 0, 0))
    assert factors(e, turned)[0] == pytest.approx([1.0] * 4, abs=0)


def test_induced_share_of_torque(drone):
    """The share is T v_h / (Q w) of static thrust and torque at any speed, at most 1."""
    static = effects.from_scene({"rotor_thrust": {}}, drone)[0]
    flow = math.sqrt(static.thrust_constant / (2.0 * math.pi * R * R))
    assert make(drone).induced == pytest.approx(static.thrust_constant * flow / static.torque_constant)
    light = drone.propeller.model_copy(update={"zero_lift_drag": 0.0, "oswald_factor": 1.0})
    assert make(drone.model_copy(update={"propeller": light})).induced == 1.0
