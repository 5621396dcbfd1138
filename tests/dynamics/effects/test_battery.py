import pytest

from lapwing.dynamics import effects
from lapwing.dynamics.effects.battery import battery, discharge, open_circuit_voltage


def make(drone, **table):
    (e,) = effects.from_scene({"battery": table}, drone)
    return e


def test_published_open_circuit_curve():
    """Chen and Rincon-Mora 2006, eq. (2), by hand at three charges."""
    assert open_circuit_voltage(1.0) == pytest.approx(3.685 + 0.2156 - 0.1178 + 0.3201)
    assert open_circuit_voltage(0.0) == pytest.approx(2.654)
    assert open_circuit_voltage(0.5) == pytest.approx(3.685 + 0.1078 - 0.02945 + 0.0400125, abs=1e-6)


def test_charge_falls_by_charge_drawn(drone, situation, rotors):
    """Charge lost times capacity is the integral of power over voltage."""
    e, memory = make(drone), make(drone).initial_discrete_state()
    drawn = 0.0
    for tick in range(250):
        before = memory
        memory = discharge.py_func(e, memory, situation(), rotors(current=10.0, voltage=32.0), (0, 0), tick, 0.1)
        drawn += 4 * 320.0 / before[1] * 0.1
    assert (1.0 - memory[0]) * 36000.0 == pytest.approx(drawn, rel=1e-9)
    assert memory[2] == pytest.approx(4 * 320.0 / memory[1], rel=1e-3)


def test_voltage_sags_with_load(drone, situation, rotors):
    e = make(drone)
    light = discharge.py_func(e, e.initial_discrete_state(), situation(), rotors(current=1.0), (0, 0), 0, 0.004)
    heavy = discharge.py_func(e, e.initial_discrete_state(), situation(), rotors(current=20.0), (0, 0), 0, 0.004)
    assert light[1] - heavy[1] == pytest.approx(12 * 0.002 * (heavy[2] - light[2]), rel=1e-3)


def test_motor_voltage_is_limited_by_battery(drone):
    assert battery.py_func(make(drone), (0.5, 40.0, 0.0), (44.4, 30.0, 0.0, 41.0)) == (40.0, 30.0, 0.0, 40.0)


def test_cutoff_is_permanent(drone, situation, rotors):
    e = make(drone, initial_charge=0.02, cutoff_voltage=3.3)
    memory = discharge.py_func(e, e.initial_discrete_state(), situation(), rotors(current=20.0), (0, 0), 0, 1.0)
    assert memory[1] == 0.0
    assert discharge.py_func(e, memory, situation(), rotors(current=0.0), (0, 0), 1, 1.0)[1] == 0.0


def test_charge_out_of_range_is_rejected(drone):
    with pytest.raises(
        ValueError, match=r"effects.battery.initial_charge: expected a number above 0 and at most 1, got 1.5"
    ):
        make(drone, initial_charge=1.5)
