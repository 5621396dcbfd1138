import pytest

from lapwing.dynamics import effects
from lapwing.dynamics.effects.battery import cut_off, discharge, open_circuit_voltage, read
from lapwing.dynamics.vehicles import multirotor

pytestmark = pytest.mark.usefixtures("uncompiled")


def make(drone, **table):
    (e,) = effects.from_scene({"battery": table}, drone)
    return e


def test_published_open_circuit_curve():
    """Chen and Rincon-Mora 2006, eq. (2), by hand at three charges."""
    assert open_circuit_voltage(1.0) == pytest.approx(3.685 + 0.2156 - 0.1178 + 0.3201)
    assert open_circuit_voltage(0.0) == pytest.approx(2.654)
    assert open_circuit_voltage(0.5) == pytest.approx(3.685 + 0.1078 - 0.02945 + 0.0400125, abs=1e-6)


def test_charge_falls_by_charge_drawn(drone, situation, rotors):
    """The rate of the charge times capacity is the power over the voltage."""
    e = make(drone)
    memory = e.initial_discrete_state()
    rate, _ = discharge.py_func(e, memory, situation(), rotors(current=10.0, voltage=32.0))
    _, voltage, current, _ = read.py_func(e, memory, 4 * 320.0)[1]
    assert -rate * 36000.0 == pytest.approx(4 * 320.0 / voltage, rel=1e-12)
    assert current == pytest.approx(4 * 320.0 / voltage, rel=1e-12)


def test_voltage_sags_with_load(drone):
    e = make(drone)
    memory = e.initial_discrete_state()
    light, heavy = (read.py_func(e, memory, power)[1] for power in (100.0, 2000.0))
    assert light[1] - heavy[1] == pytest.approx(12 * 0.002 * (heavy[2] - light[2]), rel=1e-9)


def test_motor_voltage_is_limited_by_battery(drone, situation):
    """Motors at 44.4, 30, 0 and 44 V of a pack at 5 %: its own voltage under their power, by hand."""
    p = multirotor.parameters(
        drone, effects.from_scene({"battery": {"initial_charge": 0.05}, "rotor_thrust": {}}, drone)
    )
    state = multirotor.initial_state(p, rotor_speed=330.0)
    seen = multirotor.observe.py_func(p, 0, 0.004, state, (44.4, 30.0, 0.0, 44.0))
    _, voltage, current, _ = seen.battery
    assert seen.motor_voltage == pytest.approx((voltage, 30.0, 0.0, voltage), rel=1e-12)
    assert 30.0 < voltage < 44.0
    assert voltage == pytest.approx(12 * (open_circuit_voltage(0.05) - 0.002 * current), rel=1e-12)
    assert voltage * current == pytest.approx(sum(seen.motor_power), rel=1e-12)


def test_cutoff_is_permanent(drone, situation, rotors):
    e = make(drone, initial_charge=0.02, cutoff_voltage=3.3)
    memory = cut_off.py_func(e, e.initial_discrete_state(), situation(), rotors(current=20.0), (0, 0), 0, 1.0)
    assert read.py_func(e, memory, 0.0)[0] == 0.0
    memory = cut_off.py_func(e, memory, situation(), rotors(current=0.0), (0, 0), 1, 1.0)
    assert read.py_func(e, memory, 0.0)[1][1:3] == (0.0, 0.0)


def test_charge_out_of_range_is_rejected(drone):
    with pytest.raises(
        ValueError, match=r"effects.battery.initial_charge: expected a number above 0 and at most 1, got 1.5"
    ):
        make(drone, initial_charge=1.5)
