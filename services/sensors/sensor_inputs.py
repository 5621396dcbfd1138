"""Inputs of the sensors: the true motion at a time, and the environment."""

from typing import Annotated, NamedTuple

from annotated_types import Ge, Le

from lapwing.dynamics.environment import STANDARD, Environment
from lapwing.dynamics.lie.quaternion import NO_ROTATION, Quaternion
from lapwing.dynamics.vector import ZERO, Vec3
from lapwing.dynamics.vehicles.visible_body import VisibleBody

Arm = Annotated[float, Ge(-10.0), Le(10.0)]
ROTORS = 8  # rotors whose speeds are inputs of the sensors
Place = tuple[Arm, Arm, Arm]  # [m] position of an instrument, body


class OtherVehicle(NamedTuple):
    """Another vehicle of the fleet, as a sensor sees it."""

    position_world: Vec3  # [m] of its origin
    attitude: Quaternion  # wxyz, body to world
    body: VisibleBody


class Rotors(NamedTuple):
    """Rotors of a vehicle, whatever their number."""

    speed: float = 0.0  # [rad/s] mean
    speeds: tuple[float, ...] = (0.0,) * ROTORS  # [rad/s] of the first ROTORS
    thrust: float = 0.0  # [N] sum
    current: float = 0.0  # [A] sum of their motors


class Truth(NamedTuple):
    """True state of a vehicle, and its environment."""

    position_world: Vec3 = ZERO  # [m]
    attitude: Quaternion = NO_ROTATION  # wxyz, body to world
    velocity_world: Vec3 = ZERO  # [m/s]
    omega_body: Vec3 = ZERO  # [rad/s]
    acceleration_world: Vec3 = ZERO  # [m/s^2], dv/dt
    angular_acceleration_body: Vec3 = ZERO  # [rad/s^2]
    height_above_ground: float = 0.0  # [m], of the body's origin, straight down
    air_velocity_world: Vec3 = ZERO  # [m/s] of the vehicle through the air
    air_density: float = 1.225  # [kg/m^3]
    rotors: Rotors = Rotors()
    environment: Environment = STANDARD  # its gravity acts along -z of the world; 0 without a gravity effect
    others: tuple[OtherVehicle, ...] = ()  # of a fleet, for sensors with SEES_VEHICLES
