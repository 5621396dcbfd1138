"""Inverse static motor model, from thrust to voltage (theory, eq. (4.24))."""

import math
from typing import NamedTuple

from lapwing.kernels import always_inline
from lapwing.kernels.codegen import map_tuple
from lapwing.services.common.ports import PerRotor

RPM = 30.0 / math.pi  # [rpm] per rad/s


class Motor(NamedTuple):
    """Motor parameters of the autopilot, with belt and propeller."""

    thrust_coefficient: float  # thrust over the square of the propeller's speed [N/(rad/s)^2]
    gear_ratio: float  # propeller speed / motor speed
    speed_constant: float  # KV [rpm/V]
    time_constant: float  # [s] first-order lag of the speed


@always_inline
def voltage(motor: Motor, thrust: float) -> float:
    """Return the steady voltage [V] of a thrust [N] >= 0."""
    propeller = math.sqrt(thrust / motor.thrust_coefficient)
    return RPM * propeller / (motor.gear_ratio * motor.speed_constant)


@always_inline
def _voltage(motor: Motor, thrust: float, _: float) -> float:
    return voltage(motor, thrust)


@always_inline
def voltages(motor: Motor, thrust: PerRotor) -> PerRotor:
    """Return the steady voltages [V] of thrusts [N] >= 0."""
    return map_tuple(_voltage, motor, thrust, thrust)


@always_inline
def thrust_at(motor: Motor, volts: float) -> float:
    """Return the steady thrust [N] at a voltage [V], the inverse of `voltage`."""
    propeller = motor.speed_constant * volts * motor.gear_ratio / RPM
    return motor.thrust_coefficient * propeller * propeller


@always_inline
def _thrust_at(motor: Motor, volts: float, _: float) -> float:
    return thrust_at(motor, volts)


@always_inline
def thrusts_at(motor: Motor, volts: PerRotor) -> PerRotor:
    """Return the steady thrusts [N] at voltages [V]."""
    return map_tuple(_thrust_at, motor, volts, volts)
