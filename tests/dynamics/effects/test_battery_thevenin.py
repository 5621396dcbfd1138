"""Thevenin battery against the closed form of a current step, the paper's time constants and a heat balance."""

import math

import numpy as np
import pytest

from lapwing.dynamics import effects
from lapwing.dynamics.atmosphere import Atmosphere
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.effects.battery import open_circuit_voltage
from lapwing.dynamics.effects.battery_thevenin import battery_thevenin, discharge, switch
from lapwing.dynamics.environment import Environment

OHMIC = 12 * 0.002  # [ohm] of the drone's pack
COLD = {"activation": 0.0, "heat_capacity": 1e6}  # resistances do not change


def make(drone, around=None, **table):
    (e,) = effects.from_scene({"battery_thevenin": table}, drone, around or Environment())
    return e


def after_current(e, memory, situation, rotors, current, seconds, interval=0.1):
    """Return the discrete state after the pack has supplied a constant current [A], by the classical tableau."""
    s, ticks = situation(), round(seconds / interval)

    def rate(x):
        requested = rotors(current=0.25 * current, voltage=loaded(e, x, current))
        return np.array(discharge.py_func(e, tuple(x), s, requested))

    x = np.array(memory)
    for tick in range(ticks):
        requested = rotors(current=0.25 * current, voltage=loaded(e, x, current))
        x = np.array(switch.py_func(e, tuple(x), s, requested, (0, 0), tick, interval))
        a = rate(x)
        b = rate(x + 0.5 * interval * a)
        c = rate(x + 0.5 * interval * b)
        x = x + interval / 6.0 * (a + 2.0 * b + 2.0 * c + rate(x + interval * c))
    return tuple(x)


def loaded(e, memory, current):
    """Return the voltage [V] at a current [A]."""
    charge, temperature, fast, slow, _ = memory
    ohmic = e.resistance * math.exp(e.activation * (1.0 / temperature - 1.0 / 298.15))
    return e.cells * open_circuit_voltage(charge) - fast - slow - ohmic * current


def test_voltage_after_current_step_is_two_exponentials(drone, situation, rotors):
    """At 40 A for 20 s, and back: the published ratios 0.627 and 0.669 and times 32.9 and 223 s."""
    e = make(drone, initial_charge=0.6, **COLD)
    after = after_current(e, e.initial_discrete_state(), situation, rotors, 40.0, 20.0)
    sag = OHMIC * 40.0 * (1.0 + 0.627 * (1 - math.exp(-20 / 32.9)) + 0.669 * (1 - math.exp(-20 / 223.0)))
    rest = e.cells * open_circuit_voltage(after[0])
    assert rest - loaded(e, after, 40.0) == pytest.approx(sag, rel=1e-6)
    rested = after_current(e, after, situation, rotors, 0.0, 60.0)
    left = 0.627 * (1 - math.exp(-20 / 32.9)) * math.exp(-60 / 32.9)
    left += 0.669 * (1 - math.exp(-20 / 223.0)) * math.exp(-60 / 223.0)
    assert rest - loaded(e, rested, 0.0) == pytest.approx(OHMIC * 40.0 * left, rel=1e-6)


def test_temperature_converges_to_thermal_balance(drone, situation, rotors):
    """One lump: T - T_air = P R_th (1 - exp(-t / tau)), with R_th = tau / C."""
    air = Environment(atmosphere=Atmosphere(temperature_offset=10.0))
    e = make(drone, air, initial_charge=1.0, activation=0.0, transient_resistance=[0.0, 0.0], heat_capacity=3000.0)
    kelvin = 288.15 + 10.0 - 0.0065 * air.home.height
    assert e.initial_discrete_state()[1] == pytest.approx(kelvin, abs=0.01)
    memory = after_current(e, e.initial_discrete_state(), situation, rotors, 40.0, 300.0, 1.0)
    rise = OHMIC * 40.0**2 * 1800.0 / 3000.0 * (1.0 - math.exp(-300.0 / 1800.0))
    _, (_, _, _, temperature) = battery_thevenin.py_func(e, memory, 0.0)
    assert temperature - e.initial_discrete_state()[1] == pytest.approx(rise, rel=1e-9)


def test_cold_pack_has_higher_resistance(drone):
    """By Arrhenius' law, 20 kJ/mol: at -10 degC about 2.9 times that at 25."""
    for kelvin in (263.15, 298.15):
        e = make(drone, temperature=kelvin, transient_resistance=[0.0, 0.0], heat_capacity=1e6)
        memory = e.initial_discrete_state()
        voltage, _ = battery_thevenin.py_func(e, memory, 20.0 * loaded(e, memory, 20.0))
        drop = e.cells * open_circuit_voltage(memory[0]) - voltage
        assert drop / (OHMIC * 20.0) == pytest.approx(math.exp(2400 * (1 / kelvin - 1 / 298.15)), rel=1e-6)
    assert math.exp(2400 * (1 / 263.15 - 1 / 298.15)) == pytest.approx(2.9, abs=0.05)


def test_cutoff_has_hysteresis(drone, situation, rotors):
    e = make(drone, initial_charge=0.1, cutoff_voltage=3.5, restart=3.6, **COLD)
    memory = after_current(e, e.initial_discrete_state(), situation, rotors, 100.0, 0.1)
    assert memory[4] == 0.0
    assert battery_thevenin.py_func(e, memory, 0.0)[0] == 0.0
    later = after_current(e, memory, situation, rotors, 0.0, 300.0, 1.0)
    assert later[4] == 1.0
    assert battery_thevenin.py_func(e, later, 0.0)[0] > 12 * 3.6
    final = make(drone, initial_charge=0.1, cutoff_voltage=3.5, **COLD)
    assert after_current(final, memory, situation, rotors, 0.0, 300.0, 1.0)[4] == 0.0


@pytest.mark.parametrize(
    ("table", "text"),
    [
        (
            {"restart": 2.9, "cutoff_voltage": 3.0},
            "battery_thevenin.restart: expected more than cutoff_voltage = 3 V, got 2.9 V",
        ),
        ({"cooling_time": 0.0}, r"cooling_time: expected a number at least 1 and at most 1e\+06 \[s\], got 0.0"),
        ({"temperature": 20.0}, r"temperature: expected a number at least 233.15 and at most 333.15 \[K\], got 20.0"),
    ],
)
def test_out_of_range_values_are_rejected(drone, table, text):
    with pytest.raises(ConfigError, match=text):
        make(drone, **table)


def test_two_batteries_are_rejected(drone):
    with pytest.raises(ConfigError, match=r"cannot be combined with effects.battery, also a battery model"):
        effects.from_scene({"battery": {}, "battery_thevenin": {}}, drone)


def delivered(drone, situation, rotors, rate, **table):
    """Return the charge [A h] of 10 A h that the pack delivers at `rate` C until the controllers stop."""
    e = make(drone, cutoff_voltage=3.0, **COLD, **table)
    memory, ticks, interval = e.initial_discrete_state(), 0, min(2.0, 10.0 / rate)
    while memory[4] > 0.0 and memory[0] > 0.0:
        memory = after_current(e, memory, situation, rotors, 10.0 * rate, interval, interval)
        ticks += 1
    return ticks * interval / 3600.0 * rate * 10.0


@pytest.mark.parametrize("exponent", [1.05, 1.2])
def test_exponent_follows_peukerts_law(drone, situation, rotors, exponent):
    """The delivered charge is C = C_1 I^(1 - n) times the charge without the law."""
    for rate in (2.0, 10.0):
        plain = delivered(drone, situation, rotors, rate)
        expected = plain * rate ** (1.0 - exponent)
        assert delivered(drone, situation, rotors, rate, peukert_exponent=exponent) == pytest.approx(expected, rel=0.02)


def test_branches_without_exponent_are_near_peukerts_law(drone, situation, rotors):
    """Reference: n = 1.05, usual for lithium polymer. The theory lists the differences; 20 C is cut off early."""
    base = delivered(drone, situation, rotors, 1.0)
    differences = [delivered(drone, situation, rotors, r) / (base * r**-0.05) - 1.0 for r in (2.0, 5.0, 10.0, 20.0)]
    assert differences == pytest.approx([0.033, 0.074, 0.093, -0.215], abs=0.01)


def test_exponent_has_no_effect_below_one_c(drone, situation, rotors):
    table = {"initial_charge": 0.6, **COLD}
    plain, law = make(drone, **table), make(drone, peukert_exponent=1.2, **table)
    states = [after_current(e, e.initial_discrete_state(), situation, rotors, 9.0, 5.0) for e in (plain, law)]
    assert states[0] == states[1]
