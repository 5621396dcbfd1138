"""What the sensors measure: the true motion at one instant, and the surroundings."""

from typing import NamedTuple

from dynamics.geodesy import MAGNETIC_FIELD_WORLD, Home
from dynamics.lie.quaternion import NO_ROTATION, Quaternion
from dynamics.vector import ZERO, Vec3


class Truth(NamedTuple):
    """True state of a vehicle and of the air around it."""

    position_world: Vec3 = ZERO  # [m]
    attitude: Quaternion = NO_ROTATION  # wxyz, body to world
    velocity_world: Vec3 = ZERO  # [m/s]
    omega_body: Vec3 = ZERO  # [rad/s]
    acceleration_world: Vec3 = ZERO  # [m/s^2], dv/dt
    height_above_ground: float = 0.0  # [m], of the body's origin, straight down
    gravity: float = 9.81  # [m/s^2], positive, along -z of the world
    home: Home = Home()
    temperature_celsius: float = 15.0  # [deg C], of the air
    magnetic_field_world: Vec3 = MAGNETIC_FIELD_WORLD  # [T]
