import numpy as np
import pytest
from effects_helpers import NO_LOADS

from dynamics import effects
from dynamics.effects.motor_electrics import motor_electrics

K, R = 0.0954929658551372, 0.085  # 60 / (2 pi 150) / (2/3)


def test_no_load_speed_is_the_speed_constant_less_the_idle_drop(drone, situation):
    """At V the unloaded motor turns at KV (V - R I_0), and draws I_0."""
    (e,) = effects.from_scene({"motor_electrics": {}}, drone)
    speed = (20.0 - R * 1.0) / K
    acceleration, current = motor_electrics.py_func(e, (), situation(speed=(speed,) * 4), NO_LOADS, (20.0,) * 4)
    assert current == pytest.approx([1.0] * 4)
    assert acceleration == pytest.approx([0.0] * 4, abs=1e-9)


def test_loaded_balance_and_response_rate(drone, situation):
    (e,) = effects.from_scene({"motor_electrics": {}}, drone)
    loads = NO_LOADS._replace(torque=(0.9,) * 4)
    current = 0.9 / K + 1.0
    speed = (32.0 - R * current) / K

    def acceleration(w):
        return motor_electrics.py_func(e, (), situation(speed=(w,) * 4), loads, (32.0,) * 4)[0][0]

    assert acceleration(speed) == pytest.approx(0.0, abs=1e-8)
    slope = (acceleration(speed + 1e-3) - acceleration(speed)) / 1e-3
    assert slope == pytest.approx(-(K**2) / (R * 8.6e-4), rel=1e-6)  # time constant 8 ms


def test_current_stays_within_the_controllers_limits(drone, situation):
    (e,) = effects.from_scene({"motor_electrics": {}}, drone)
    _, current = motor_electrics.py_func(e, (), situation(speed=(0, 0, 400, 400)), NO_LOADS, (44.4, 0.0, 0.0, 44.4))
    assert current[:3] == (80.0, 0.0, 0.0)
    assert 0 < current[3] < 80


def test_power_balance(drone, situation):
    """Electrical power is shaft power plus winding heat plus idle loss plus what accelerates the rotor."""
    (e,) = effects.from_scene({"motor_electrics": {}}, drone)
    loads = NO_LOADS._replace(torque=(0.5,) * 4)
    acceleration, current = motor_electrics.py_func(e, (), situation(speed=(280,) * 4), loads, (30.0,) * 4)
    i = current[0]
    spent = 0.5 * 280 + R * i**2 + K * 1.0 * 280 + 8.6e-4 * acceleration[0] * 280
    assert np.isclose(30.0 * i, spent, rtol=1e-12)
