import numpy as np
import pytest

from dynamics.effects.wind_random import WindRandom, draw, told, wind_random
from dynamics.noise import stream_key

KEY = stream_key(3, "drone1", "effects")


def test_force_of_a_steady_wind_is_the_source_formula(situation, rotors):
    e = WindRandom((3.0, 1.0, 0.0), 0.0)
    s = situation(velocity=(1, 1, 0))
    memory = draw.py_func(e, e.initial_memory(), s, rotors(), KEY, 0, 0.004)
    force, torque = wind_random.py_func(e, memory, s, rotors())
    assert force == pytest.approx((0.5 * 1.0 * 0.06 * 1.22 * 2.0**2, 0.0, 0.0))
    assert torque == (0.0, 0.0, 0.0)


def test_draws_have_mean_and_deviation(situation, rotors):
    """The wind's draws, got back from the force: F = k |v| v."""
    e, s = WindRandom((3.0, 1.0, 0.0), 0.7), situation()
    forces = np.array([draw.py_func(e, (), s, rotors(), KEY, tick, 0.004)[0] for tick in range(2000)])
    size = np.linalg.norm(forces, axis=1, keepdims=True)
    wind = forces / np.sqrt(size * 0.5 * 0.06 * 1.22)
    assert wind.mean(axis=0) == pytest.approx((3.0, 1.0, 0.0), abs=4 * 0.7 / np.sqrt(2000))
    assert wind.std(axis=0) == pytest.approx((0.7,) * 3, rel=0.07)


def test_depends_on_tick_and_key_only(situation, rotors):
    e, s = WindRandom(), situation()
    other = ((1.0, 2.0, 3.0), (4.0, 5.0, 6.0))
    one = draw.py_func(e, other, s, rotors(), KEY, 7, 0.004)
    assert one == draw.py_func(e, e.initial_memory(), s, rotors(), KEY, 7, 0.01)
    assert one != draw.py_func(e, e.initial_memory(), s, rotors(), KEY, 8, 0.004)
    assert one != draw.py_func(e, e.initial_memory(), s, rotors(), stream_key(4, "drone1", "effects"), 7, 0.004)


def test_the_wind_that_makes_the_force_is_told(situation, rotors):
    """The truth's wind: 0 before, though the vehicle was blown about."""
    e, s = WindRandom((3.0, 1.0, 0.0), 0.7), situation(velocity=(1, 1, 0))
    memory = draw.py_func(e, e.initial_memory(), s, rotors(), KEY, 5, 0.004)
    wind = np.array(told.py_func(e, memory, (0.5, 0.0, 0.0))) - (0.5, 0.0, 0.0)
    past = wind - (1.0, 1.0, 0.0)
    assert memory[0] == pytest.approx(0.5 * 0.06 * 1.22 * np.linalg.norm(past) * past)
