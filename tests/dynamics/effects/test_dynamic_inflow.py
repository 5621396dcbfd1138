"""Dynamic inflow against momentum theory: blades and disc have equal thrust in hover, climb and forward flight."""

import math

import numpy as np
import pytest
from effects_helpers import NO_FACTORS, NO_LOADS
from scipy.optimize import brentq

from lapwing.dynamics import effects
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.effects.dynamic_inflow import dynamic_inflow, fastest_approach, follow
from lapwing.dynamics.effects.rotor_thrust import rotor_thrust

pytestmark = pytest.mark.usefixtures("uncompiled")

SPEED, DENSITY = 300.0, 1.2


def make(drone):
    e, static = effects.from_scene({"rotor_thrust": {}, "dynamic_inflow": {}}, drone)
    return e, static


def settled(e, s, rotors, seconds=1.0, interval=0.004):
    memory = e.initial_discrete_state()
    for _ in range(round(seconds / interval)):
        rate = follow.py_func(e, memory, s, rotors())
        memory = tuple(v + interval * dv for v, dv in zip(memory, rate, strict=True))
    return memory


def loads(e, static, memory, s):
    before = rotor_thrust.py_func(static, (), s, NO_FACTORS, NO_LOADS)
    return before, dynamic_inflow.py_func(e, memory, s, NO_FACTORS, before)


def test_hover_loads_are_static(drone, situation, rotors):
    e, static = make(drone)
    s = situation()
    memory = settled(e, s, rotors)
    before, after = loads(e, static, memory, s)
    assert memory[0] == pytest.approx(math.sqrt(before.thrust[0] / (2 * DENSITY * e.area)))
    assert np.array(after) == pytest.approx(np.array(before))


@pytest.mark.parametrize("velocity", [(0, 0, 2), (0, 0, 5), (8, 0, 0), (3, -4, 1), (12, 0, -1)])
def test_blades_and_disc_agree(drone, situation, rotors, velocity):
    """T = slope rho w (P w - V - v) = 2 rho A v sqrt(V_xy^2 + (V + v)^2), solved independently."""
    e, static = make(drone)
    s = situation(velocity=velocity)
    across, climb = math.hypot(*velocity[:2]), velocity[2]

    def difference(v):
        blades = e.slope * SPEED * (drone.propeller.pitch / (2 * math.pi) * SPEED - climb - v)
        return blades - 2 * e.area * v * math.hypot(across, climb + v)

    v = brentq(difference, 0.0, 20.0)
    memory = settled(e, s, rotors)
    before, after = loads(e, static, memory, s)
    assert memory == pytest.approx([v] * 4, rel=1e-6)
    thrust = 2 * DENSITY * e.area * v * math.hypot(across, climb + v)
    assert after.thrust == pytest.approx([thrust] * 4, rel=1e-6)
    static_power = before.torque[0] * SPEED - before.thrust[0] * e.hover * SPEED  # profile
    assert after.torque[0] * SPEED == pytest.approx(static_power + thrust * (climb + v), rel=1e-6)


@pytest.mark.parametrize("velocity", [(0, 0, 0), (0, 0, 2), (8, 0, 0)])
def test_induced_power_factor_scales_flow(drone, situation, rotors, velocity):
    """The flow, solved independently, is 1.15 times that of momentum theory; static loads are unchanged."""
    propeller = drone.propeller.model_copy(update={"induced_power_factor": 1.15})
    e, static = make(drone.model_copy(update={"propeller": propeller}))
    s = situation(velocity=velocity)
    across, climb = math.hypot(*velocity[:2]), velocity[2]

    def difference(v):
        blades = e.slope * SPEED * (drone.propeller.pitch / (2 * math.pi) * SPEED - climb - v)
        return blades - 2 * e.area * v / 1.15 * math.hypot(across, climb + v / 1.15)

    memory = settled(e, s, rotors)
    assert memory == pytest.approx([brentq(difference, 0.0, 20.0)] * 4, rel=1e-6)
    if not any(velocity):
        before, after = loads(e, static, memory, s)
        assert np.array(after) == pytest.approx(np.array(before))


def test_translational_lift_and_descent(drone, situation, rotors):
    """Forward flight reduces the flow: more thrust for less power. Descent raises it more than climb reduces it."""
    e, static = make(drone)
    thrust, torque = [], []
    for velocity in ((0, 0, 0), (10, 0, 0), (0, 0, 2), (0, 0, -2)):
        s = situation(velocity=velocity)
        _, after = loads(e, static, settled(e, s, rotors), s)
        thrust.append(after.thrust[0])
        torque.append(after.torque[0])
    assert thrust[1] > 1.2 * thrust[0]
    assert torque[1] / thrust[1] < torque[0] / thrust[0]
    assert abs(thrust[3] - thrust[0]) < 0.5 * abs(thrust[2] - thrust[0])


def test_inflow_rate_follows_apparent_mass(drone, situation, rotors):
    """About hover m v' = -(4 rho A v_h + slope rho w) (v - v_h), with 0.637 of a sphere of air."""
    e, _ = make(drone)
    s = situation()
    hover = e.hover * SPEED
    mass = 0.637 * 4 / 3 * math.pi * (0.5 * drone.propeller.diameter) ** 3
    rate = (4 * e.area * hover + e.slope * SPEED) / mass
    assert follow.py_func(e, (hover + 1e-4,) * 4, s, rotors()) == pytest.approx([-1e-4 * rate] * 4, rel=1e-3)
    assert fastest_approach.py_func(e, (), s.motion, s.body, s.layout) > rate


def test_inflow_follows_speed_of_each_hub(drone, situation, rotors):
    e, static = make(drone)
    s = situation(omega=(1.0, 0.0, 0.0))
    _, after = loads(e, static, settled(e, situation(), rotors), s)
    assert after.thrust[0] < after.thrust[2]  # the left side goes up
    assert after.thrust[0] == pytest.approx(after.thrust[1])


def test_rotor_at_rest_has_no_loads(drone, situation, rotors):
    e, static = make(drone)
    s = situation(speed=(0.0,) * 4, velocity=(3, 0, -2))
    memory = settled(e, s, rotors)
    assert np.isfinite(memory).all()
    assert loads(e, static, memory, s)[1] == ((0.0,) * 4, (0.0,) * 4)


def test_axial_inflow_and_small_pitch_are_rejected(drone):
    with pytest.raises(ConfigError, match=r"also a flow through the rotors"):
        effects.from_scene({"axial_inflow": {}, "dynamic_inflow": {}}, drone)
    flat = drone.model_copy(update={"propeller": drone.propeller.model_copy(update={"pitch": 0.02})})
    with pytest.raises(ConfigError, match=r"effects.dynamic_inflow: the propeller's pitch must be at least"):
        effects.from_scene({"dynamic_inflow": {}}, flat)
