"""The turbulence against the spectra, scales and intensities of MIL-F-8785C, section 3.7.3."""

import math

import numpy as np
import pytest
from scipy.signal import welch

from dynamics import effects
from dynamics.effects.wind_dryden import draw
from dynamics.kernel import kernel
from dynamics.noise import stream_key

KEY = stream_key(5, "drone1", "effects")
FOOT = 0.3048


def make(drone, **table):
    (e,) = effects.from_scene({"wind_dryden": {"wind_speed": 7.0, "airspeed": 8.0, **table}}, drone)
    return e


@kernel
def series(e, memory, s, rotors, key, interval, out):
    for tick in range(out.shape[0]):
        memory = draw(e, memory, s, rotors, key, tick, interval)
        wind = memory[1]
        out[tick, 0], out[tick, 1], out[tick, 2] = wind[0], wind[1], wind[2]


def test_scales_and_intensities(drone):
    """At 1000 feet all scales are 1000 feet and all intensities a tenth of the wind at 20 feet; at 100 feet by hand."""
    e = make(drone, altitude=304.8)
    assert e.sigma == pytest.approx((0.7, 0.7, 0.7), rel=1e-12)
    assert e.decay_rate == pytest.approx((8.0 / 304.8,) * 3, rel=1e-12)
    e = make(drone, altitude=100 * FOOT)
    base = 0.177 + 0.0823
    assert e.sigma == pytest.approx((0.7 / base**0.4, 0.7 / base**0.4, 0.7))
    assert 8.0 / np.array(e.decay_rate) == pytest.approx(np.array([100 / base**1.2, 100 / base**1.2, 100]) * FOOT)


def test_spectra(drone, situation, rotors):
    e, interval, airspeed = make(drone, altitude=20.0), 0.02, 8.0
    wind = np.empty((2**19, 3))
    series(e, e.initial_memory(), situation(), rotors(), KEY, interval, wind)
    frequency, power = welch(wind, fs=1 / interval, nperseg=2**13, axis=0)
    omega = 2 * math.pi * frequency
    band = (omega > 0.05) & (omega < 0.2 / interval)
    omega, power = omega[band], power[band] / (2 * math.pi)  # per rad/s, one-sided
    for axis in range(3):
        scale, sigma = airspeed / e.decay_rate[axis], e.sigma[axis]
        x = (scale * omega / airspeed) ** 2
        if axis == 0:
            published = sigma**2 * 2 * scale / (math.pi * airspeed) / (1 + x)
        else:
            published = sigma**2 * scale / (math.pi * airspeed) * (1 + 3 * x) / (1 + x) ** 2
        ratio = power[:, axis] / published
        octaves = [part.mean() for part in np.array_split(ratio, 12)]
        assert octaves == pytest.approx(np.ones(12), abs=0.12)
    assert wind.std(axis=0) == pytest.approx(e.sigma, rel=0.05)
    assert np.corrcoef(wind.T) == pytest.approx(np.eye(3), abs=0.06)


def test_starts_stationary_and_is_exact_at_any_interval(drone, situation, rotors):
    """The spread over seeds is the intensity at the first exchange, and after one long interval too."""
    e = make(drone, altitude=20.0)
    first, second = [], []
    for seed in range(1500):
        key = stream_key(seed, "", "effects")
        memory = draw(e, e.initial_memory(), situation(), rotors(), key, 0, 0.004)
        first.append(memory[1])
        second.append(draw(e, memory, situation(), rotors(), key, 1, 3.0)[1])
    assert np.std(first, axis=0) == pytest.approx(e.sigma, rel=0.08)
    assert np.std(second, axis=0) == pytest.approx(e.sigma, rel=0.08)
    lag = [np.corrcoef(np.array(first)[:, k], np.array(second)[:, k])[0, 1] for k in range(3)]
    theta = 3.0 * np.array(e.decay_rate)
    expected = np.exp(-theta) * [1.0, 1 - theta[1] / 2, 1 - theta[2] / 2]  # autocorrelations of the Dryden spectra
    assert lag == pytest.approx(expected, abs=0.08)


def test_heading_turns_the_axes(drone, situation, rotors):
    along = draw(make(drone), make(drone).initial_memory(), situation(), rotors(), KEY, 0, 0.01)[1]
    e = make(drone, heading=math.pi / 2)
    turned = draw(e, e.initial_memory(), situation(), rotors(), KEY, 0, 0.01)[1]
    assert turned == pytest.approx((-along[1], along[0], along[2]))
