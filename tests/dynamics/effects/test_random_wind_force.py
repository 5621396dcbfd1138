import numpy as np
import pytest
from scipy.signal import welch

from lapwing.dynamics import effects
from lapwing.dynamics.effects.random_wind_force import draw, random_wind_force, reported_wind
from lapwing.dynamics.noise import stream_key
from lapwing.kernels import kernel

WIND = {"mean": [3.0, 1.0, 0.0], "sigma": 0.7}
KEY = stream_key(3, "drone1", "effects")


def make(drone, **table):
    (e,) = effects.from_scene({"random_wind_force": {**WIND, **table}}, drone)
    return e


def test_force_of_steady_wind_follows_source_formula(drone, situation, rotors):
    e = make(drone, sigma=0.0)
    s = situation(velocity=(1, 1, 0))
    memory = draw.py_func(e, e.initial_discrete_state(), s, rotors(), KEY, 0, 0.004)
    force, torque = random_wind_force.py_func(e, memory, s, rotors())
    assert force == pytest.approx((0.5 * 1.0 * 0.06 * 1.22 * 2.0**2, 0.0, 0.0))
    assert torque == (0.0, 0.0, 0.0)


def test_draws_have_mean_and_deviation(drone, situation, rotors):
    """The draws of the wind are recovered from the force F = k |v| v."""
    e, s = make(drone), situation()
    forces = np.array([draw.py_func(e, (), s, rotors(), KEY, tick, 0.004)[0] for tick in range(2000)])
    size = np.linalg.norm(forces, axis=1, keepdims=True)
    wind = forces / np.sqrt(size * 0.5 * 0.06 * 1.22)
    assert wind.mean(axis=0) == pytest.approx((3.0, 1.0, 0.0), abs=4 * 0.7 / np.sqrt(2000))
    assert wind.std(axis=0) == pytest.approx((0.7,) * 3, rel=0.07)


def test_force_depends_on_tick_and_key_only(drone, situation, rotors):
    e, s = make(drone), situation()
    other = ((1.0, 2.0, 3.0), (4.0, 5.0, 6.0))
    one = draw.py_func(e, other, s, rotors(), KEY, 7, 0.004)
    assert one == draw.py_func(e, e.initial_discrete_state(), s, rotors(), KEY, 7, 0.004)
    assert one != draw.py_func(e, e.initial_discrete_state(), s, rotors(), KEY, 8, 0.004)
    assert one != draw.py_func(e, e.initial_discrete_state(), s, rotors(), stream_key(4, "drone1", "effects"), 7, 0.004)


def test_wind_of_force_is_reported(drone, situation, rotors):
    """The reported wind is that of the force."""
    e, s = make(drone), situation(velocity=(1, 1, 0))
    memory = draw.py_func(e, e.initial_discrete_state(), s, rotors(), KEY, 5, 0.004)
    wind = np.array(reported_wind.py_func(e, memory, (0.5, 0.0, 0.0))) - (0.5, 0.0, 0.0)
    past = wind - (1.0, 1.0, 0.0)
    assert memory[0] == pytest.approx(0.5 * 0.06 * 1.22 * np.linalg.norm(past) * past)


@kernel
def series(e, memory, s, rotors, key, interval, out):
    for tick in range(out.shape[0]):
        memory = draw(e, memory, s, rotors, key, tick, interval)
        force, wind = memory
        out[tick, 0], out[tick, 1] = force[0], wind[0]


def test_spectrum_does_not_depend_on_exchange_interval(drone, situation, rotors):
    """Wind and force (linearised about the mean) have the two-sided density sigma^2 T below the draw frequency."""
    e, densities, means = make(drone), [], []
    for interval in (0.001, 0.004, 0.01, 0.02):
        out = np.empty((round(800.0 / interval), 2))
        series(e, e.initial_discrete_state(), situation(), rotors(), KEY, interval, out)
        frequency, power = welch(out, fs=1 / interval, nperseg=round(4.0 / interval), axis=0)
        densities.append(power[(frequency > 0.5) & (frequency < 10.0)].mean(axis=0) / 2)
        means.append(out[:, 0].mean())
    assert np.array(densities)[:, 1] == pytest.approx([0.7**2 * 0.004] * 4, rel=0.05)
    assert np.array(densities)[:, 0] == pytest.approx([densities[1][0]] * 4, rel=0.05)
    assert means == pytest.approx([means[1]] * 4, rel=0.01)


def test_short_ticks_share_draws_and_long_ticks_average_them(drone, situation, rotors):
    e, start = make(drone), make(drone).initial_discrete_state()

    def at(tick, interval, memory=start, velocity=(0.0, 0.0, 0.0)):
        return draw.py_func(e, memory, situation(velocity=velocity), rotors(), KEY, tick, interval)

    first = at(28, 0.001)
    assert first == at(7, 0.004)
    assert first == at(31, 0.001, first, velocity=(2.0, 0.0, 0.0))  # the force of the draw's start
    assert at(32, 0.001, first) == at(8, 0.004)
    parts = [np.array(at(tick, 0.004)) for tick in (2, 3, 4)]
    assert np.array(at(1, 0.01)) == pytest.approx((parts[0] / 2 + parts[1] + parts[2]) / 2.5)


def test_drag_is_not_counted_twice(drone):
    with pytest.raises(ValueError, match=r"^effects.random_wind_force: includes drag.*allow_body_drag = true"):
        effects.from_scene({"random_wind_force": {}, "body_drag": {}}, drone)
    assert len(effects.from_scene({"random_wind_force": {"allow_body_drag": True}, "body_drag": {}}, drone)) == 2
