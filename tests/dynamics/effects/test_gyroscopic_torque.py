import numpy as np
import pytest

from lapwing.dynamics import effects
from lapwing.dynamics.effects.gyroscopic_torque import gyroscopic_torque


def test_torque_is_minus_change_of_rotors_momentum(drone, situation, rotors):
    """Rotor k turns at -sign_k w_k about body z: torque on the body -(L' + omega x L)."""
    (e,) = effects.from_scene({"gyroscopic_torque": {}}, drone)
    speed, acceleration = (300, 310, 280, 350), (50.0, -20.0, 70.0, 10.0)
    omega = np.array([0.3, -0.7, 1.1])
    torque = gyroscopic_torque.py_func(e, (), situation(omega=omega, speed=speed), rotors(acceleration=acceleration))
    axis = -np.array([1, -1, 1, -1]) * 8.6e-4
    momentum, change = np.array([0, 0, axis @ speed]), np.array([0, 0, axis @ acceleration])
    assert torque == pytest.approx(-(change + np.cross(omega, momentum)), rel=1e-12)


def test_equal_rotors_cancel(drone, situation, rotors):
    (e,) = effects.from_scene({"gyroscopic_torque": {}}, drone)
    torque = gyroscopic_torque.py_func(e, (), situation(omega=(1, 2, 3)), rotors())
    assert torque == pytest.approx((0, 0, 0), abs=1e-15)
