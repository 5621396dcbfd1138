import math

import pytest
from closed_loop import MOTOR

from lapwing.services.autopilot.motor import thrust_at, voltage


def test_voltage_follows_belt_and_speed_constant():
    propeller_rpm = 3000.0
    thrust = MOTOR.thrust_coefficient * (propeller_rpm * math.pi / 30.0) ** 2
    assert voltage(MOTOR, thrust) == pytest.approx(propeller_rpm * 3.0 / 2.0 / 150.0)


@pytest.mark.parametrize("thrust", [0.0, 1e-3, 24.6, 48.0])
def test_thrust_at_inverts_voltage(thrust):
    assert thrust_at(MOTOR, voltage(MOTOR, thrust)) == pytest.approx(thrust, rel=1e-14)
