"""Angular gusts against the spectra of MIL-F-8785C, section 3.7.5, as one-sided densities over omega."""

import math

import numpy as np
import pytest
from effects_helpers import NO_FACTORS, NO_LOADS
from scipy.signal import welch

from lapwing.dynamics import effects
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.effects import wind_dryden
from lapwing.dynamics.effects._turbulence import intensity, on_line
from lapwing.dynamics.effects._types import Air
from lapwing.dynamics.effects.axial_inflow import axial_inflow
from lapwing.dynamics.effects.wind_dryden_rates import add_gust_rate, draw, wind_dryden_rates
from lapwing.dynamics.noise import stream_key
from lapwing.dynamics.vector import ZERO
from lapwing.kernels import kernel

KEY = stream_key(5, "drone1", "effects")
AIRSPEED, ALTITUDE, SPAN, WIND = 8.0, 20.0, 1.5, 7.0
TABLE = {"wind_speed": WIND, "airspeed": AIRSPEED, "altitude": ALTITUDE, "span": SPAN}


def make(drone, **table):
    (e,) = effects.from_scene({"wind_dryden_rates": {**TABLE, **table}}, drone)
    return e


@kernel
def series(e, memory, s, rotors, key, interval, out):
    for tick in range(out.shape[0]):
        memory = draw(e, memory, s, rotors, key, tick, interval)
        out[tick, 0], out[tick, 1], out[tick, 2] = memory[4][0]


def published(omega):
    """Return densities [(rad/s)^2 s/rad] of p, q and r."""
    sigma, scale = intensity(WIND, ALTITUDE)
    w, v = (
        sigma[i] ** 2 * scale[i] / (math.pi * AIRSPEED) * (1 + 3 * x) / (1 + x) ** 2
        for i in (2, 1)
        for x in [(scale[i] * omega / AIRSPEED) ** 2]
    )
    four, three = (n * SPAN * omega / (math.pi * AIRSPEED) for n in (4.0, 3.0))
    p = sigma[2] ** 2 / (AIRSPEED * scale[2]) * 0.8 * (math.pi * scale[2] / (4 * SPAN)) ** (1 / 3) / (1 + four**2)
    return np.column_stack(
        [p, (omega / AIRSPEED) ** 2 / (1 + four**2) * w, (omega / AIRSPEED) ** 2 / (1 + three**2) * v]
    )


@pytest.mark.parametrize("interval", [0.01, 0.03])
def test_spectra_hold_at_any_interval(drone, situation, rotors, interval):
    rate = np.empty((2**18, 3))
    e = make(drone)
    series(e, e.initial_discrete_state(), situation(), rotors(), KEY, interval, rate)
    frequency, power = welch(rate, fs=1 / interval, nperseg=2**12, axis=0)
    omega = 2 * math.pi * frequency
    band = (omega > 0.2) & (omega < 0.1 * 2 * math.pi / interval)
    ratio = power[band] / (2 * math.pi) / published(omega[band])
    for axis in range(3):
        assert [part.mean() for part in np.array_split(ratio[:, axis], 8)] == pytest.approx(np.ones(8), abs=0.12)


def test_standard_deviations_from_first_exchange_on(drone, situation, rotors):
    """The spread over seeds is the root of the spectrum's integral, at once and after a long interval."""
    omega = np.geomspace(1e-3, 1e4, 20000)
    expected = np.sqrt(np.trapezoid(published(omega), omega, axis=0))
    e, first, second = make(drone), [], []
    for seed in range(800):
        key = stream_key(seed, "", "effects")
        memory = draw(e, e.initial_discrete_state(), situation(), rotors(), key, 0, 0.004)
        first.append(memory[4][0])
        second.append(on_line(draw(e, memory, situation(), rotors(), key, 1, 2.0)[4], 2.0))
    assert np.std(first, axis=0) == pytest.approx(expected, rel=0.1)
    assert np.std(second, axis=0) == pytest.approx(expected, rel=0.1)


def test_gusts_equal_wind_dryden_bit_for_bit(drone, situation, rotors):
    e = make(drone)
    (plain,) = effects.from_scene({"wind_dryden": {key: TABLE[key] for key in TABLE if key != "span"}}, drone)
    ours, theirs = e.initial_discrete_state(), plain.initial_discrete_state()
    for tick in range(20):
        ours = draw(e, ours, situation(), rotors(), KEY, tick, 0.02)
        theirs = wind_dryden.draw(plain, theirs, situation(), rotors(), KEY, tick, 0.02)
        assert ours[:3] == (theirs[0][0], *theirs[1:])


def test_rising_gust_lifts_nose(drone, situation, rotors):
    """A field that passes at V along x has dw/dx = -(1/V) dw/dt: the air turns about y at -dw/dx."""
    e, interval, low_pass = make(drone), 0.001, 4 * SPAN / (math.pi * AIRSPEED)
    memory, rows = e.initial_discrete_state(), []
    for tick in range(3000):
        memory = draw(e, memory, situation(), rotors(), KEY, tick, interval)
        rows.append((*(on_line(line, interval * tick - memory[2]) for line in (memory[1], memory[4])),))
    wind, rate = np.array(rows)[:, 0], np.array(rows)[:, 1]
    slow = wind[0].copy()
    for i, gust in enumerate(wind):
        slow += interval / low_pass * (gust - slow)
        if i > 1500:
            assert rate[i, 1] == pytest.approx((gust - slow)[2] / (low_pass * AIRSPEED), abs=2e-3)
    assert np.corrcoef(wind[1:, 1] - wind[:-1, 1], rate[1:, 2] - rate[:-1, 2])[0, 1] < -0.99


def test_air_rotation_acts_on_rotors_like_body_rotation(drone, situation):
    (inflow,) = effects.from_scene({"axial_inflow": {}}, drone)
    s = situation(omega=(0.3, -0.2, 0.1))
    other = situation()
    other = other._replace(air_rate_body=(-0.3, 0.2, -0.1))
    assert axial_inflow.py_func(inflow, (), s, NO_FACTORS, NO_LOADS) == axial_inflow.py_func(
        inflow, (), other, NO_FACTORS, NO_LOADS
    )


def test_rates_depend_on_vehicle_span(drone, situation):
    (e,) = effects.from_scene({"wind_dryden_rates": {"wind_speed": 7.0}}, drone)
    assert e.span == pytest.approx(2 * 0.4974 + 0.5588)
    memory = ((0.0,) * 5, ((1.0, 2.0, 3.0), ZERO), 0.0, ZERO, ((0.1, 0.2, 0.3), ZERO))
    s = situation(turn=(0, 0, math.pi / 2))
    assert wind_dryden_rates.py_func(e, memory, s, Air(1.2, (0.0, 0.0, 0.0))).wind_world == (1.0, 2.0, 3.0)
    assert add_gust_rate.py_func(e, memory, s, (1.0, 0.0, 0.0)) == pytest.approx((1.2, -0.1, 0.3))
    with pytest.raises(ConfigError, match=r"cannot be combined with effects\.wind_dryden, also a turbulence"):
        effects.from_scene({"wind_dryden": {"wind_speed": 7.0}, "wind_dryden_rates": {"wind_speed": 7.0}}, drone)
