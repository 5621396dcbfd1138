"""Von Karman turbulence: closed form and random draws against published spectra."""

import math

import numpy as np
import pytest
from scipy.signal import welch

from lapwing.dynamics import effects
from lapwing.dynamics.effects._turbulence import intensity
from lapwing.dynamics.effects._types import Air
from lapwing.dynamics.effects.wind_von_karman import PARTS, draw, wind_von_karman
from lapwing.dynamics.noise import stream_key
from lapwing.dynamics.vector import ZERO
from lapwing.kernels import kernel

KEY = stream_key(5, "drone1", "effects")


def published(x):
    """Return (along, across) of MIL-F-8785C, 3.7.1.1, one-sided over x = L omega / V, unit variance and L / V."""
    square = (1.339 * x) ** 2
    along = 2.0 / math.pi / (1.0 + square) ** (5 / 6)
    return along, (1.0 + 8.0 / 3.0 * square) / (1.0 + square) ** (11 / 6) / math.pi


def spectra_of_parts(x):
    """Return (along, across) of the sum of the parts, as `published`."""
    along = sum(2.0 / math.pi * c**2 * r / (r**2 + x**2) for r, c, _ in PARTS)
    return along, sum(c**2 * r * (r**2 + 3.0 * x**2) / (r**2 + x**2) ** 2 for r, c, _ in PARTS) / math.pi


def test_sum_of_parts_is_von_karman_spectrum():
    x = np.logspace(-2, 5.9, 400)
    for ours, theirs in zip(spectra_of_parts(x), published(x), strict=True):
        assert ours / theirs == pytest.approx(np.ones(len(x)), abs=0.03)
    assert sum(c**2 for _, c, _ in PARTS) == pytest.approx(1.0, abs=0.005)


@pytest.mark.parametrize("rate", [100.0, 250.0])
@pytest.mark.parametrize("airspeed", [0.1, 1.0, 8.0, 60.0])
@pytest.mark.parametrize("altitude", [3.048, 20.0, 60.0, 304.8])
def test_air_has_von_karman_spectrum_up_to_third_of_nyquist_rate(rate, airspeed, altitude):
    """Linear interpolation of samples: the sum over all aliases, multiplied by sinc^4."""
    frequency = np.geomspace(0.01, rate / 6.0, 100)
    aliases = np.abs(frequency[:, None] + rate * np.arange(-5000, 5001))
    for scale, axis in zip(intensity(7.0, altitude)[1][1:], (0, 1), strict=True):
        x = 2.0 * math.pi * scale / airspeed
        ours = spectra_of_parts(x * aliases)[axis].sum(axis=1) * np.sinc(frequency / rate) ** 4
        assert np.abs(ours / published(x * frequency)[axis] - 1.0).max() < 0.03


def test_turbulence_is_equal_at_any_communication_rate_and_linear_between_samples(drone, situation, rotors):
    (e,) = effects.from_scene({"wind_von_karman": {"wind_speed": 7.0}}, drone)
    winds = []
    for rate in (250, 500, 1000):
        memory, wind = e.initial_discrete_state(), np.empty((40, 3))
        for quarter in range(len(wind)):  # of 4 ms
            if quarter * rate % 1000 == 0:
                memory = draw(e, memory, situation(), rotors(), KEY, quarter * rate // 1000, 1.0 / rate)
            wind[quarter] = wind_von_karman(e, memory, situation(t=1e-3 * quarter), Air(1.2, ZERO)).wind_world
        winds.append(wind)
    assert winds[1] == pytest.approx(winds[0], rel=1e-12, abs=1e-12)
    assert winds[2] == pytest.approx(winds[0], rel=1e-12, abs=1e-12)
    assert np.abs(np.diff(winds[0], 2, axis=0)[np.arange(38) % 4 != 3]).max() < 1e-14


@kernel
def series(e, memory, s, rotors, key, interval, out):
    for tick in range(out.shape[0]):
        memory = draw(e, memory, s, rotors, key, tick, interval)
        out[tick, 0], out[tick, 1], out[tick, 2] = memory[1][0]


def test_spectra(drone, situation, rotors):
    table = {"wind_speed": 7.0, "airspeed": 8.0, "altitude": 20.0}
    (e,) = effects.from_scene({"wind_von_karman": table}, drone)
    interval, (sigma, scale) = 0.02, intensity(7.0, 20.0)
    wind = np.empty((2**19, 3))
    series(e, e.initial_discrete_state(), situation(), rotors(), KEY, interval, wind)
    frequency, power = welch(wind, fs=1 / interval, nperseg=2**13, axis=0)
    omega = 2 * math.pi * frequency
    band = (omega > 0.05) & (omega < 0.2 / interval)
    omega, power = omega[band], power[band] / (2 * math.pi)  # per rad/s, one-sided
    for axis in range(3):
        lag = scale[axis] / 8.0
        ratio = power[:, axis] / (sigma[axis] ** 2 * lag * published(lag * omega)[axis > 0])
        octaves = [part.mean() for part in np.array_split(ratio, 12)]
        assert octaves == pytest.approx(np.ones(12), abs=0.12)
    assert wind.std(axis=0) == pytest.approx(sigma, rel=0.05)
    assert np.corrcoef(wind.T) == pytest.approx(np.eye(3), abs=0.06)


def test_excludes_dryden(drone):
    table = {"wind_speed": 7.0}
    with pytest.raises(ValueError, match=r"cannot be combined with effects\.wind_dryden, also a turbulence"):
        effects.from_scene({"wind_von_karman": table, "wind_dryden": table}, drone)
