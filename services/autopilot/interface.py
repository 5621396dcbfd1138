"""What goes into the controller and what comes out of it."""

from typing import NamedTuple

from lapwing.dynamics.lie.quaternion import Quaternion
from lapwing.dynamics.vector import Vec3

PerRotor = tuple[float, ...]  # as many as the vehicle has rotors


class Estimate(NamedTuple):
    """What the controller believes of the vehicle."""

    position_world: Vec3  # [m]
    attitude: Quaternion  # body to world
    velocity_world: Vec3  # [m/s]
    omega_body: Vec3  # [rad/s]


class Setpoint(NamedTuple):
    """What the vehicle is asked to do now."""

    position_world: Vec3  # [m]
    velocity_world: Vec3  # [m/s]
    acceleration_world: Vec3  # [m/s^2]
    yaw: float  # [rad]
    yaw_rate: float  # [rad/s]


class Command(NamedTuple):
    """The controller's output."""

    motor_voltage: PerRotor  # [V]
    thrust: PerRotor  # asked of each rotor [N]
    roll_reference: float  # what the inner loop follows [rad]
    pitch_reference: float  # [rad]
    yaw_reference: float  # [rad]
    finished: bool  # landed, motors off for good
