import pytest
from effects_helpers import NO_FACTORS

from lapwing.dynamics import effects
from lapwing.dynamics.effects.rotor_damage import rotor_damage, strike


def test_damage_acts_on_one_rotor_from_its_time(drone, situation):
    (e,) = effects.from_scene(
        {"rotor_damage": {"rotor": 2, "time": 4.0, "remaining_thrust": 0.6, "remaining_torque": 1.1}}, drone
    )
    memory = strike.py_func(e, e.initial_discrete_state(), 3.99)
    assert rotor_damage.py_func(e, memory, situation(), NO_FACTORS) == NO_FACTORS
    memory = strike.py_func(e, memory, 4.0)
    hurt = rotor_damage.py_func(e, memory, situation(), NO_FACTORS)
    assert hurt == ((1.0, 0.6, 1.0, 1.0), (1.0, 1.1, 1.0, 1.0))


def test_missing_rotor_is_rejected(drone):
    with pytest.raises(
        ValueError, match=r"effects.rotor_damage.rotor: expected one of the vehicle's rotors, 1 to 4, got 5"
    ):
        effects.from_scene({"rotor_damage": {"rotor": 5}}, drone)
