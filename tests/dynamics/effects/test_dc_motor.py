import numpy as np
import pytest
from effects_helpers import NO_LOADS

from lapwing.dynamics import effects
from lapwing.dynamics.effects.dc_motor import dc_motor

K, R = 0.0954929658551372, 0.085  # 60 / (2 pi 150) / (2/3)


def test_no_load_speed_is_the_speed_constant_less_the_idle_drop(drone, situation):
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


def test_current_stays_within_the_controllers_limits(drone, situation):
    (e,) = effects.from_scene({"dc_motor": {}}, drone)
    _, current, _ = dc_motor.py_func(e, (), situation(speed=(0, 0, 400, 450)), NO_LOADS, (44.4, 0.0, 0.0, 44.4))
    assert current[:3] == (29.7, 0.0, 0.0)  # Table 1; the controller would give 80
    assert 0 < current[3] < 29.7


def test_power_balance(drone, situation):
    """Electrical power is shaft power plus winding heat plus idle loss plus what accelerates the rotor."""
    (e,) = effects.from_scene({"dc_motor": {}}, drone)
    loads = NO_LOADS._replace(torque=(0.5,) * 4)
    acceleration, current, _ = dc_motor.py_func(e, (), situation(speed=(280,) * 4), loads, (29.0,) * 4)
    i = current[0]
    spent = 0.5 * 280 + R * i**2 + K * 1.0 * 280 + 8.6e-4 * acceleration[0] * 280
    assert np.isclose(29.0 * i, spent, rtol=1e-12)


def changed(drone, **motor):
    motor = drone.motor.model_copy(update=motor)
    (e,) = effects.from_scene({"dc_motor": {}}, drone.model_copy(update={"motor": motor}))
    return e


def test_the_motor_takes_no_more_than_its_peak_power(drone, situation):
    """A step to full voltage with the current free: K w I + R I^2 is the limit until the back-EMF is near it."""
    e = changed(drone, peak_current=None)
    speeds = (0.0, 150.0, 200.0, 440.0)
    _, current, _ = dc_motor.py_func(e, (), situation(speed=speeds), NO_LOADS, (44.4,) * 4)
    power = [i * (K * w + R * i) for i, w in zip(current, speeds, strict=True)]
    assert current[0] == 75.0  # a quarter of the pack's 30 C, 478 W; the controller would give 80
    assert power[1:3] == pytest.approx([1272.0] * 2)
    assert current[3] == pytest.approx((44.4 - K * 440.0) / R)


def test_resistance_of_the_controller_belt_and_inertia_of_the_motor(drone, situation):
    """Stall torque, no-load balance and response rate by hand."""
    e = changed(drone, esc_resistance=0.015, belt_efficiency=0.96, inertia=1e-4, peak_current=None, peak_power=None)
    loads = NO_LOADS._replace(torque=(0.5,) * 4)
    inertia = 8.6e-4 + 1e-4 / (2 / 3) ** 2
    speed = 280.0
    acceleration, current, _ = dc_motor.py_func(e, (), situation(speed=(speed,) * 4), loads, (30.0,) * 4)
    assert current[0] == pytest.approx((30.0 - K * speed) / 0.1)
    assert acceleration[0] == pytest.approx((0.96 * K * (current[0] - 1.0) - 0.5) / inertia)


def test_power_is_that_of_what_flows_also_where_the_controller_limits_it(drone, situation):
    """29.7 A into a rotor at rest is R I^2, not the 44.4 V asked for times 29.7 A; running free it is V I."""
    e = changed(drone, peak_power=None)
    _, current, power = dc_motor.py_func(e, (), situation(speed=(0, 200, 440, 470)), NO_LOADS, (44.4,) * 4)
    assert current[:2] == (29.7, 29.7)
    assert power[0] == pytest.approx(R * 29.7**2)
    assert power[1] == pytest.approx(29.7 * (K * 200.0 + R * 29.7))
    assert power[2:] == tuple(44.4 * i for i in current[2:])
    limited = changed(drone, peak_current=None)
    assert dc_motor.py_func(limited, (), situation(speed=(200,) * 4), NO_LOADS, (44.4,) * 4)[2] == pytest.approx(
        [1272.0] * 4
    )


def test_the_controllers_efficiency_is_paid_by_the_battery_alone(drone, situation):
    s, loads = situation(speed=(300,) * 4), NO_LOADS._replace(torque=(0.5,) * 4)
    ideal, lossy = (dc_motor.py_func(changed(drone, esc_efficiency=f), (), s, loads, (30.0,) * 4) for f in (1.0, 0.9))
    assert lossy[:2] == ideal[:2]
    assert np.multiply(lossy[2], 0.9) == pytest.approx(ideal[2])


def test_the_batterys_c_rating_is_shared_by_the_motors(drone, situation):
    """2 C of 10 A h is 20 A, a quarter for each motor."""
    weak = drone.model_copy(update={"battery": drone.battery.model_copy(update={"c_rating": 2.0})})
    (e,) = effects.from_scene({"dc_motor": {}}, weak)
    _, current, _ = dc_motor.py_func(e, (), situation(speed=(100,) * 4), NO_LOADS, (44.4,) * 4)
    assert current == pytest.approx([5.0] * 4)
