"""Inputs and outputs of the control law."""

from typing import NamedTuple

from lapwing.dynamics.lie.quaternion import Quaternion
from lapwing.dynamics.vector import Vec3

PerRotor = tuple[float, ...]  # one value per rotor


class Estimate(NamedTuple):
    """State estimate for the controller."""

    position_world: Vec3  # [m]
    attitude: Quaternion  # body to world
    velocity_world: Vec3  # [m/s]
    omega_body: Vec3  # [rad/s]


class Setpoint(NamedTuple):
    """Desired motion."""

    position_world: Vec3  # [m]
    velocity_world: Vec3  # [m/s]
    acceleration_world: Vec3  # [m/s^2]
    yaw: float  # [rad]
    yaw_rate: float  # [rad/s]


class Command(NamedTuple):
    """The controller's output."""

    motor_voltage: PerRotor  # [V]
    thrust: PerRotor  # [N]
    roll_reference: float  # of the inner loop [rad]
    pitch_reference: float  # [rad]
    yaw_reference: float  # [rad]
    finished: bool  # landed, motors off
