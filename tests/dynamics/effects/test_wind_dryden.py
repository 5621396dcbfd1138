"""Dryden turbulence against the spectra, scales and intensities of MIL-F-8785C, section 3.7.3."""

import math

import numpy as np
import pytest
from scipy.signal import welch

from lapwing.dynamics import effects
from lapwing.dynamics.effects._turbulence import deviation_and_rate, intensity, on_line
from lapwing.dynamics.effects.wind_dryden import draw
from lapwing.dynamics.environment import Environment
from lapwing.dynamics.noise import stream_key
from lapwing.dynamics.terrain import relief
from lapwing.kernels import kernel

KEY = stream_key(5, "drone1", "effects")
FOOT = 0.3048


def make(drone, **table):
    values = {"wind_speed": 7.0, "airspeed": 8.0, "altitude": 10.0, **table}
    (e,) = effects.from_scene({"wind_dryden": values}, drone)
    return e


@kernel
def series(e, memory, s, rotors, key, interval, out):
    for tick in range(out.shape[0]):
        memory = draw(e, memory, s, rotors, key, tick, interval)
        wind = memory[1][0]
        out[tick, 0], out[tick, 1], out[tick, 2] = wind[0], wind[1], wind[2]


def test_scales_and_intensities(drone):
    """At 1000 feet all scales are 1000 feet and all intensities a tenth of the wind at 20 feet; at 100 feet by hand."""
    sigma, scale = intensity(7.0, 304.8)
    assert sigma == pytest.approx((0.7, 0.7, 0.7), rel=1e-12)
    assert scale == pytest.approx((304.8,) * 3, rel=1e-12)
    sigma, scale = intensity(7.0, 100 * FOOT)
    base = 0.177 + 0.0823
    assert sigma == pytest.approx((0.7 / base**0.4, 0.7 / base**0.4, 0.7))
    assert scale == pytest.approx(np.array([100 / base**1.2, 100 / base**1.2, 100]) * FOOT)


@pytest.mark.parametrize("slope", [0.0, 0.2])
def test_turbulence_follows_height_and_airspeed(drone, situation, rotors, slope, uncompiled):
    """The spectra equal those at a given height and airspeed."""
    around = Environment(terrain=relief(slope=(slope, 0.0)))
    (follows,) = effects.from_scene({"wind_dryden": {"wind_speed": 7.0}}, drone, around)
    s = situation(position=(50.0, 0, 30.0 + 50.0 * slope), velocity=(6.0, 0, 8.0), wind=(0.0, 0.0, 3.0))
    fixed = make(drone, airspeed=math.hypot(6.0, 5.0), altitude=30.0)
    ours, values = (draw(e, e.initial_discrete_state(), s, rotors(), KEY, 0, 0.01) for e in (follows, fixed))
    assert ours[1][0] == pytest.approx(values[1][0], rel=1e-12)
    low, high, still = (deviation_and_rate(follows.conditions, situation(**where)) for where in (
        {"position": (0, 0, 1.0), "velocity": (5, 0, 0)}, {"position": (0, 0, 2000.0), "velocity": (5, 0, 0)},
        {"position": (0, 0, 20.0)}))  # fmt: skip
    assert low == deviation_and_rate(make(drone, airspeed=5.0, altitude=3.048).conditions, s)
    assert high == deviation_and_rate(make(drone, airspeed=5.0, altitude=304.8).conditions, s)
    assert still[1] == deviation_and_rate(make(drone, airspeed=0.1, altitude=20.0).conditions, s)[1]


def test_spectra(drone, situation, rotors):
    e, interval, airspeed = make(drone, altitude=20.0), 0.02, 8.0
    wind = np.empty((2**19, 3))
    series(e, e.initial_discrete_state(), situation(), rotors(), KEY, interval, wind)
    frequency, power = welch(wind, fs=1 / interval, nperseg=2**13, axis=0)
    omega = 2 * math.pi * frequency
    band = (omega > 0.05) & (omega < 0.2 / interval)
    omega, power = omega[band], power[band] / (2 * math.pi)  # per rad/s, one-sided
    sigmas, scales = intensity(7.0, 20.0)
    for axis in range(3):
        scale, sigma = scales[axis], sigmas[axis]
        x = (scale * omega / airspeed) ** 2
        if axis == 0:
            published = sigma**2 * 2 * scale / (math.pi * airspeed) / (1 + x)
        else:
            published = sigma**2 * scale / (math.pi * airspeed) * (1 + 3 * x) / (1 + x) ** 2
        ratio = power[:, axis] / published
        octaves = [part.mean() for part in np.array_split(ratio, 12)]
        assert octaves == pytest.approx(np.ones(12), abs=0.12)
    assert wind.std(axis=0) == pytest.approx(sigmas, rel=0.05)
    assert np.corrcoef(wind.T) == pytest.approx(np.eye(3), abs=0.06)


def test_starts_stationary_and_is_exact_at_any_interval(drone, situation, rotors):
    """The spread over seeds is the intensity at the first exchange, and after one long interval too."""
    e = make(drone, altitude=20.0)
    sigma, scale = intensity(7.0, 20.0)
    first, second = [], []
    for seed in range(1500):
        key = stream_key(seed, "", "effects")
        memory = draw(e, e.initial_discrete_state(), situation(), rotors(), key, 0, 0.004)
        first.append(memory[1][0])
        second.append(on_line(draw(e, memory, situation(), rotors(), key, 1, 3.0)[1], 3.0))
    assert np.std(first, axis=0) == pytest.approx(sigma, rel=0.08)
    assert np.std(second, axis=0) == pytest.approx(sigma, rel=0.08)
    lag = [np.corrcoef(np.array(first)[:, k], np.array(second)[:, k])[0, 1] for k in range(3)]
    theta = 3.0 * 8.0 / np.array(scale)
    expected = np.exp(-theta) * [1.0, 1 - theta[1] / 2, 1 - theta[2] / 2]  # autocorrelations of the Dryden spectra
    assert lag == pytest.approx(expected, abs=0.08)


def test_heading_turns_axes(drone, situation, rotors):
    along = draw(make(drone), make(drone).initial_discrete_state(), situation(), rotors(), KEY, 0, 0.01)[1][0]
    e = make(drone, direction_to=math.pi / 2)
    turned = draw(e, e.initial_discrete_state(), situation(), rotors(), KEY, 0, 0.01)[1][0]
    assert turned == pytest.approx((-along[1], along[0], along[2]))
