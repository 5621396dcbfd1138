"""What effects look at and give: plain NamedTuples of floats."""

from typing import Any, NamedTuple

import numpy as np

from lapwing.dynamics import small_matrices
from lapwing.dynamics.lie.quaternion import Quaternion
from lapwing.dynamics.vector import Mat3, Vec3

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


class FullMassProperties(NamedTuple):
    """Mass properties with products of inertia."""

    mass: float  # [kg]
    inverse_mass: float  # [1/kg]
    inertia: Mat3  # [kg m^2] matrix about the centre of mass, along the body axes
    inverse_inertia: Mat3  # [1/(kg m^2)]


class OffsetMassProperties(NamedTuple):
    """Mass properties of a body whose centre of mass is not where the motion's position is."""

    mass: float  # [kg]
    inverse_mass: float  # [1/kg]
    inertia: Mat3  # [kg m^2] matrix about the centre of mass, along the body axes
    inverse_inertia: Mat3  # [1/(kg m^2)]
    centre_body: Vec3  # [m] centre of mass, from the motion's position


AnyMassProperties = MassProperties | FullMassProperties | OffsetMassProperties


def steiner(mass: float, arm: np.ndarray) -> np.ndarray:
    """What a mass [kg] at an arm [m] adds to an inertia matrix [kg m^2], shape (3, 3): the parallel axis theorem."""
    return mass * (small_matrices.dot(arm, arm) * np.eye(3) - np.multiply.outer(arm, arm))


def offset_body(mass: float, inertia: np.ndarray, centre_body: np.ndarray) -> OffsetMassProperties:
    """Mass properties about a centre of mass [m] off the motion's position; inertia [kg m^2], shape (3, 3)."""
    matrix, inverse = (tuple(m.ravel().tolist()) for m in (inertia, small_matrices.inverse(inertia)))
    return OffsetMassProperties(mass, 1.0 / mass, matrix, inverse, tuple(np.asarray(centre_body, float).tolist()))


def body_of(mass: float, inertia: Vec3, products: Vec3 = (0.0, 0.0, 0.0)) -> MassProperties | FullMassProperties:
    """Mass properties with what the hot path needs of them.

    Args:
        mass: [kg].
        inertia: diagonal of the inertia matrix [kg m^2].
        products: its elements xy, xz and yz [kg m^2].
    """
    x, y, z = inertia
    if any(products):
        xy, xz, yz = products
        matrix = (x, xy, xz, xy, y, yz, xz, yz, z)
        inverse = (
            y * z - yz * yz,
            xz * yz - xy * z,
            xy * yz - xz * y,
            x * z - xz * xz,
            xy * xz - x * yz,
            x * y - xy * xy,
        )
        a, b, c, d, e, f = (v / (x * inverse[0] + xy * inverse[1] + xz * inverse[2]) for v in inverse)
        return FullMassProperties(mass, 1.0 / mass, matrix, (a, b, c, b, d, e, c, e, f))
    return MassProperties(
        mass, 1.0 / mass, inertia, (1.0 / x, 1.0 / y, 1.0 / z), ((y - z) / x, (z - x) / y, (x - y) / z)
    )


def principal_moments(inertia: Vec3, products: Vec3) -> tuple[float, ...]:
    """Of an inertia matrix, in rising order [kg m^2]; arguments as of `body_of`."""
    if not any(products):
        return tuple(sorted(inertia))
    (x, y, z), (xy, xz, yz) = inertia, products
    return tuple(small_matrices.symmetric_eigenvalues([[x, xy, xz], [xy, y, yz], [xz, yz, z]]))


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


class WakeSlopes(NamedTuple):
    """How the loads of rotors hang together of which some stand in the wake of others; empty where none does.

    Row by row over the thrust that each rotor would have by itself, about one speed of all (theory.md, eq. (2.45)).
    """

    thrust: tuple[PerRotor, ...] = ()  # of each rotor
    torque: tuple[PerRotor, ...] = ()  # [m] what each rotor's torque gains


class Rotors(NamedTuple):
    """All that is known of the rotors once the motors have been evaluated."""

    thrust: PerRotor  # [N]
    torque: PerRotor  # [N m]
    acceleration: PerRotor  # [rad/s^2]
    current: PerRotor  # [A] of each motor
    voltage: PerRotor  # [V] asked of each controller
    power: PerRotor  # [W] taken by each motor and its controller


class EffectInputs(NamedTuple):
    """What an effect may look at."""

    t: float  # [s] simulation time
    motion: Motion
    R_world_body: Mat3
    body: Any  # AnyMassProperties
    layout: Any  # RotorLayout, see lapwing/dynamics/vehicles/multirotor_equations.py
    air: Air
    air_rate_body: Vec3  # [rad/s] at which the air turns, body coordinates
