import numpy as np
import pytest
from effects_helpers import NO_LOADS
from scipy.linalg import expm

from lapwing.dynamics import effects
from lapwing.dynamics.effects._types import Rotors
from lapwing.dynamics.effects.dc_motor import continue_current, dc_motor

pytestmark = pytest.mark.usefixtures("uncompiled")

K, R = 0.0954929658551372, 0.085  # 60 / (2 pi 150) / (2/3)


def test_no_load_speed_is_speed_constant_less_idle_drop(drone, situation):
    """At V the unloaded motor turns at KV (V - R I_0), and draws I_0."""
    (e,) = effects.from_scene({"dc_motor": {}}, drone)
    speed = (20.0 - R * 1.0) / K
    acceleration, current, _ = dc_motor.py_func(e, (), situation(speed=(speed,) * 4), NO_LOADS, (20.0,) * 4)
    assert current == pytest.approx([1.0] * 4)
    assert acceleration == pytest.approx([0.0] * 4, abs=1e-9)


def test_loaded_balance_and_response_rate(drone, situation):
    (e,) = effects.from_scene({"dc_motor": {}}, drone)
    loads = NO_LOADS._replace(torque=(0.9,) * 4)
    current = 0.9 / K + 1.0
    speed = (32.0 - R * current) / K

    def acceleration(w):
        return dc_motor.py_func(e, (), situation(speed=(w,) * 4), loads, (32.0,) * 4)[0][0]

    assert acceleration(speed) == pytest.approx(0.0, abs=1e-8)
    slope = (acceleration(speed + 1e-3) - acceleration(speed)) / 1e-3
    assert slope == pytest.approx(-(K**2) / (R * 8.6e-4), rel=1e-6)  # time constant 8 ms


def test_current_stays_within_controllers_limits(drone, situation):
    (e,) = effects.from_scene({"dc_motor": {}}, drone)
    _, current, _ = dc_motor.py_func(e, (), situation(speed=(0, 0, 400, 450)), NO_LOADS, (44.4, 0.0, 0.0, 44.4))
    assert current[:3] == (26.5, 0.0, 0.0)  # Table 1; the controller's limit is 80
    assert 0 < current[3] < 26.5


def test_power_balance(drone, situation):
    """Electrical power is the sum of shaft power, winding heat, idle loss and power that accelerates the rotor."""
    (e,) = effects.from_scene({"dc_motor": {}}, drone)
    loads = NO_LOADS._replace(torque=(0.5,) * 4)
    acceleration, current, _ = dc_motor.py_func(e, (), situation(speed=(281,) * 4), loads, (29.0,) * 4)
    i = current[0]
    spent = 0.5 * 281 + R * i**2 + K * 1.0 * 281 + 8.6e-4 * acceleration[0] * 281
    assert np.isclose(29.0 * i, spent, rtol=1e-12)


def changed(drone, **motor):
    motor = drone.motor.model_copy(update=motor)
    (e,) = effects.from_scene({"dc_motor": {}}, drone.model_copy(update={"motor": motor}))
    return e


def test_motor_power_is_at_most_peak_power(drone, situation):
    """Without a current limit, K w I + R I^2 is limited after a voltage step until the back-EMF is near 44.4 V."""
    e = changed(drone, peak_current=None)
    speeds = (0.0, 150.0, 200.0, 440.0)
    _, current, _ = dc_motor.py_func(e, (), situation(speed=speeds), NO_LOADS, (44.4,) * 4)
    power = [i * (K * w + R * i) for i, w in zip(current, speeds, strict=True)]
    assert current[0] == 75.0  # a quarter of the pack's 30 C, 478 W; the controller's limit is 80
    assert power[1:3] == pytest.approx([1272.0] * 2)
    assert current[3] == pytest.approx((44.4 - K * 440.0) / R)


def test_resistance_of_controller_belt_and_inertia_of_motor(drone, situation):
    """Stall torque, no-load balance and response rate by hand."""
    e = changed(drone, esc_resistance=0.015, belt_efficiency=0.96, inertia=1e-4, peak_current=None, peak_power=None)
    loads = NO_LOADS._replace(torque=(0.5,) * 4)
    inertia = 8.6e-4 + 1e-4 / (2 / 3) ** 2
    speed = 280.0
    acceleration, current, _ = dc_motor.py_func(e, (), situation(speed=(speed,) * 4), loads, (30.0,) * 4)
    assert current[0] == pytest.approx((30.0 - K * speed) / 0.1)
    assert acceleration[0] == pytest.approx((0.96 * K * (current[0] - 1.0) - 0.5) / inertia)


def test_power_follows_limited_current(drone, situation):
    """At 26.5 A a rotor at rest takes R I^2, not the desired 44.4 V times 26.5 A; a free-running rotor takes V I."""
    e = changed(drone, peak_power=None)
    _, current, power = dc_motor.py_func(e, (), situation(speed=(0, 200, 442, 470)), NO_LOADS, (44.4,) * 4)
    assert current[:2] == (26.5, 26.5)
    assert power[0] == pytest.approx(R * 26.5**2)
    assert power[1] == pytest.approx(26.5 * (K * 200.0 + R * 26.5))
    assert power[2:] == tuple(44.4 * i for i in current[2:])
    limited = changed(drone, peak_current=None)
    assert dc_motor.py_func(limited, (), situation(speed=(200,) * 4), NO_LOADS, (44.4,) * 4)[2] == pytest.approx(
        [1272.0] * 4
    )


def test_controller_efficiency_affects_battery_only(drone, situation):
    s, loads = situation(speed=(300,) * 4), NO_LOADS._replace(torque=(0.5,) * 4)
    ideal, lossy = (dc_motor.py_func(changed(drone, esc_efficiency=f), (), s, loads, (30.0,) * 4) for f in (1.0, 0.9))
    assert lossy[:2] == ideal[:2]
    assert np.multiply(lossy[2], 0.9) == pytest.approx(ideal[2])


def test_batterys_c_rating_is_shared_by_motors(drone, situation):
    """2 C of 10 A h is 20 A, a quarter for each motor."""
    weak = drone.model_copy(update={"battery": drone.battery.model_copy(update={"c_rating": 2.0})})
    (e,) = effects.from_scene({"dc_motor": {}}, weak)
    _, current, _ = dc_motor.py_func(e, (), situation(speed=(100,) * 4), NO_LOADS, (44.4,) * 4)
    assert current == pytest.approx([5.0] * 4)


def stepped(drone, s, voltages, start, seconds, step=2e-5, **table):
    """Return speeds of an unloaded motor without idle current, by the midpoint rule; shape (n,).

    All voltages last equally long.
    """
    motor = drone.motor.model_copy(update={"peak_current": None, "peak_power": None, "no_load_current": 0.0})
    frame = drone.model_copy(update={"motor": motor.model_copy(update={"esc_current": 1e4}), "battery": None})
    (e,) = effects.from_scene({"dc_motor": table}, frame)
    w, speeds, memory = start, [], e.initial_discrete_state()
    count = round(seconds / step / len(voltages))

    def at(t, w):
        return s._replace(t=t, motion=s.motion._replace(rotor_speed=(w,) * 4))

    for number, voltage in enumerate(voltages):
        rotors = Rotors(*NO_LOADS, (0.0,) * 4, (0.0,) * 4, (voltage,) * 4, (0.0,) * 4)
        memory = continue_current.py_func(e, memory, at(number * count * step, w), rotors, (0, 0), number, 0.0)
        for k in range(number * count, (number + 1) * count):
            speeds.append(w)
            a = dc_motor.py_func(e, memory, at(k * step, w), NO_LOADS, (voltage,) * 4)[0][0]
            b = dc_motor.py_func(e, memory, at((k + 0.5) * step, w + 0.5 * step * a), NO_LOADS, (voltage,) * 4)[0][0]
            w += step * b
    return np.array(speeds)


@pytest.mark.parametrize("inductance", [1e-5, 5e-5, 1.4e-4])
def test_inductance_follows_second_order_step(drone, situation, inductance):
    """The reference is the closed form of L I' = V - K w - R I, J w' = K I after a voltage step, with its transient."""
    electrical, mechanical = inductance / R, 8.6e-4 * R / K**2
    speeds = stepped(drone, situation(), [5.0], 0.0, 0.03, inductance=inductance, braking_current=1e4)
    t = np.arange(len(speeds)) * 2e-5
    b, a = sorted(np.roots([electrical * mechanical, mechanical, 1.0]).real)
    exact = 5.0 / K * (1 + (b * np.exp(a * t) - a * np.exp(b * t)) / (a - b))
    assert np.abs(speeds - exact).max() < 1e-3 * 5.0 / K
    without = 5.0 / K * (1 - np.exp(-t / mechanical))
    missed = np.abs(without - exact).max() / (electrical / mechanical * 5.0 / K)
    assert 0.55 < missed < 0.95  # theory, section 2.6


def test_current_is_continuous_when_voltage_changes(drone, situation):
    """The reference for three voltages is the state-space solution of speed and current by the matrix exponential."""
    inductance, J = 5e-5, 8.6e-4
    speeds = stepped(drone, situation(), [5.0, 9.0, 2.0], 0.0, 0.006, inductance=inductance, braking_current=1e4)
    A = np.array([[0.0, K / J, 0.0], [-K / inductance, -R / inductance, 1.0 / inductance], [0.0, 0.0, 0.0]])
    step, x, exact = expm(A * 2e-5), np.array([0.0, 0.0, 5.0]), []
    for voltage in (5.0, 9.0, 2.0):
        x[2] = voltage
        for _ in range(100):
            exact.append(x[0])
            x = step @ x
    assert speeds == pytest.approx(exact, abs=2e-2)


def test_braking_slows_down_as_fast_as_closed_form(drone, situation):
    """A shorted winding slows w at the rate K^2/(J R); at the current limit w falls in proportion to time."""
    free = stepped(drone, situation(), [0.0], 300.0, 0.02, braking_current=1e4)
    t = np.arange(len(free)) * 2e-5
    assert free == pytest.approx(300.0 * np.exp(-t * K**2 / (8.6e-4 * R)), rel=1e-5)
    limited = stepped(drone, situation(), [0.0], 300.0, 0.02, braking_current=20.0)
    assert limited == pytest.approx(300.0 - K * 20.0 / 8.6e-4 * t, rel=1e-9)
    assert stepped(drone, situation(), [0.0], 300.0, 0.001) == pytest.approx([300.0] * 50)  # it does not brake


def test_braking_returns_power(drone, situation):
    """P = I (K w + R I) at I = -20 A: 400 W at 29 V less the loss, times the controller's efficiency."""
    motor = drone.motor.model_copy(update={"esc_efficiency": 0.9})
    (e,) = effects.from_scene({"dc_motor": {"braking_current": 20.0}}, drone.model_copy(update={"motor": motor}))
    _, current, power = dc_motor.py_func(e, (), situation(speed=(300,) * 4), NO_LOADS, (0.0, 27.8, 28.0, 30.0))
    assert current[:2] == pytest.approx([-20.0, (27.8 - K * 300) / R])
    assert power[0] == pytest.approx(-20.0 * (K * 300.0 - 20.0 * R) * 0.9)
    assert power[1] == pytest.approx(27.8 * current[1] * 0.9)
    assert power[3] == pytest.approx(30.0 * current[3] / 0.9)


def test_large_inductance_is_rejected(drone):
    with pytest.raises(ValueError, match=r"inductance: expected at most 0.00015 H for this motor, got 0.001 H"):
        effects.from_scene({"dc_motor": {"inductance": 1e-3}}, drone)
