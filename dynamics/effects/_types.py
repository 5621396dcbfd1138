"""What effects look at and give: plain NamedTuples of floats."""

from typing import Any, NamedTuple

from dynamics.lie.quaternion import Quaternion
from dynamics.vector import Mat3, Vec3

PerRotor = tuple[float, ...]


class Motion(NamedTuple):
    """What the integrator advances."""

    position_world: Vec3  # [m] of the centre of mass
    attitude: Quaternion  # takes body to world coordinates
    velocity_world: Vec3  # [m/s]
    omega_body: Vec3  # [rad/s]
    rotor_speed: PerRotor  # [rad/s], not negative


class MassProperties(NamedTuple):
    """Mass properties; inertia along the body axes."""

    mass: float  # [kg]
    inverse_mass: float  # [1/kg]
    inertia: Vec3  # [kg m^2]
    inverse_inertia: Vec3  # [1/(kg m^2)]
    gyration: Vec3  # ((I_y - I_z) / I_x, (I_z - I_x) / I_y, (I_x - I_y) / I_z)


def body_of(mass: float, inertia: Vec3) -> MassProperties:
    """Mass properties with what the hot path needs of them."""
    x, y, z = inertia
    return MassProperties(
        mass, 1.0 / mass, inertia, (1.0 / x, 1.0 / y, 1.0 / z), ((y - z) / x, (z - x) / y, (x - y) / z)
    )


class Air(NamedTuple):
    """The air at the vehicle."""

    density: float  # [kg/m^3]
    wind_world: Vec3  # [m/s]


class Factors(NamedTuple):
    """What multiplies each rotor's static loads."""

    thrust: PerRotor
    torque: PerRotor


class Loads(NamedTuple):
    """What the air does to each rotor."""

    thrust: PerRotor  # [N] along body z
    torque: PerRotor  # [N m] against its rotation


class Rotors(NamedTuple):
    """All that is known of the rotors once the motors have been evaluated."""

    thrust: PerRotor  # [N]
    torque: PerRotor  # [N m]
    acceleration: PerRotor  # [rad/s^2]
    current: PerRotor  # [A] of each motor
    voltage: PerRotor  # [V] at each motor


class Situation(NamedTuple):
    """What an effect may look at."""

    t: float  # [s] simulation time
    motion: Motion
    R_world_body: Mat3
    body: MassProperties
    layout: Any  # RotorLayout, see dynamics/vehicles/multirotor.py
    air: Air
