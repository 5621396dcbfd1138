"""Uniform wind, and the effects that use it."""

import pytest

from lapwing.dynamics import effects
from lapwing.dynamics.effects.wind_constant import WindConstant, wind_constant
from lapwing.dynamics.vehicles import multirotor

pytestmark = pytest.mark.usefixtures("uncompiled")


def test_uniform_wind_is_added(situation):
    s = situation(wind=(1, 0, 0), density=1.1)
    assert wind_constant.py_func(WindConstant((2.0, -1.0, 0.5)), (), s, s.air) == (1.1, (3.0, -1.0, 0.5))


def test_every_aerodynamic_effect_feels_motion_of_air(drone):
    """Rest in wind equals flight against it in still air for drag, H-force and inflow (Galileo)."""
    tables = {"rotor_thrust": {}, "axial_inflow": {}, "body_drag": {}, "h_force": {}}
    wind = (4.0, -2.0, 1.0)
    still = multirotor.parameters(drone, effects.from_scene(tables, drone))
    windy = multirotor.parameters(drone, effects.from_scene({**tables, "wind_constant": {"velocity": wind}}, drone))
    start = {"position_world": (0.0, 0.0, 20.0), "rotor_speed": 330.0, "omega_body": (0.5, -0.3, 0.2)}
    against = tuple(-v for v in wind)
    one = multirotor.observe(windy, 0, 0.004, multirotor.initial_state(windy, **start), (32.0,) * 4)
    other = multirotor.observe(
        still, 0, 0.004, multirotor.initial_state(still, **start, velocity_world=against), (32.0,) * 4
    )
    assert one.acceleration_world == pytest.approx(other.acceleration_world, abs=1e-12)
    assert one.angular_acceleration_body == pytest.approx(other.angular_acceleration_body, abs=1e-11)
    assert one.motor_power == pytest.approx(other.motor_power)
    assert one.acceleration_world[0] > 0.1
