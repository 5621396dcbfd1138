"""Inputs of the sensors: the true motion at a time, and the environment."""

from typing import Annotated, Any, NamedTuple

from annotated_types import Ge, Le

from lapwing.dynamics.atmosphere import Atmosphere
from lapwing.dynamics.environment import STANDARD
from lapwing.dynamics.geodesy import Home
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


class Truth(NamedTuple):
    """True state of a vehicle, and its environment."""

    position_world: Vec3 = ZERO  # [m]
    attitude: Quaternion = NO_ROTATION  # wxyz, body to world
    velocity_world: Vec3 = ZERO  # [m/s]
    omega_body: Vec3 = ZERO  # [rad/s]
    acceleration_world: Vec3 = ZERO  # [m/s^2], dv/dt
    height_above_ground: float = 0.0  # [m], of the body's origin, straight down
    gravity: float = 9.81  # [m/s^2], positive, along -z of the world
    home: Home = STANDARD.home
    atmosphere: Atmosphere = STANDARD.atmosphere
    magnetic_field_world: Vec3 = STANDARD.magnetic_field_world  # [T]
    terrain: Any = STANDARD.terrain  # Level or Relief
    angular_acceleration_body: Vec3 = ZERO  # [rad/s^2]
    motor_current: float = 0.0  # [A] of all motors
    air_velocity_world: Vec3 = ZERO  # [m/s] of the vehicle through the air
    air_density: float = 1.225  # [kg/m^3]
    thrust: float = 0.0  # [N] of all rotors
    rotor_speed: float = 0.0  # [rad/s] mean of the rotors
    rotor_speeds: tuple[float, ...] = (0.0,) * ROTORS  # [rad/s] of the first rotors
    others: tuple[OtherVehicle, ...] = ()  # of a fleet, for sensors with SEES_VEHICLES
