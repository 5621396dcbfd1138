"""Inputs and outputs of effects: NamedTuples of floats."""

from typing import Any, NamedTuple

import numpy as np

from lapwing.dynamics import small_matrices
from lapwing.dynamics.lie.quaternion import Quaternion
from lapwing.dynamics.vector import Mat3, Vec3

PerRotor = tuple[float, ...]


class Motion(NamedTuple):
    """State that the integrator advances."""

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
    """Mass properties of a body whose centre of mass is not at the motion's position."""

    mass: float  # [kg]
    inverse_mass: float  # [1/kg]
    inertia: Mat3  # [kg m^2] matrix about the centre of mass, along the body axes
    inverse_inertia: Mat3  # [1/(kg m^2)]
    centre_body: Vec3  # [m] centre of mass, from the motion's position


AnyMassProperties = MassProperties | FullMassProperties | OffsetMassProperties


def steiner(mass: float, arm: np.ndarray) -> np.ndarray:
    """Return the inertia matrix [kg m^2], shape (3, 3), of a point mass [kg] at an arm [m]: parallel axis theorem."""
    return mass * (small_matrices.dot(arm, arm) * np.eye(3) - np.multiply.outer(arm, arm))


def offset_body(mass: float, inertia: np.ndarray, centre_body: np.ndarray) -> OffsetMassProperties:
    """Return mass properties about a centre of mass [m] off the motion's position; inertia [kg m^2], shape (3, 3)."""
    matrix, inverse = (tuple(m.ravel().tolist()) for m in (inertia, small_matrices.inverse(inertia)))
    return OffsetMassProperties(mass, 1.0 / mass, matrix, inverse, tuple(np.asarray(centre_body, float).tolist()))


def body_of(mass: float, inertia: Vec3, products: Vec3 = (0.0, 0.0, 0.0)) -> MassProperties | FullMassProperties:
    """Return mass properties with the derived values of the hot path.

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
    """Return the ascending principal moments of inertia [kg m^2]. See `body_of` for arguments."""
    if not any(products):
        return tuple(sorted(inertia))
    (x, y, z), (xy, xz, yz) = inertia, products
    return tuple(small_matrices.symmetric_eigenvalues([[x, xy, xz], [xy, y, yz], [xz, yz, z]]))


class Air(NamedTuple):
    """The air at the vehicle."""

    density: float  # [kg/m^3]
    wind_world: Vec3  # [m/s]


class Factors(NamedTuple):
    """Factors on each rotor's static loads."""

    thrust: PerRotor
    torque: PerRotor


class Loads(NamedTuple):
    """Aerodynamic loads of each rotor."""

    thrust: PerRotor  # [N] along body z
    torque: PerRotor  # [N m] against its rotation


class WakeSlopes(NamedTuple):
    """Coupling of the loads of rotors in the wakes of others; empty without any.

    A row and a column per rotor, relative to the isolated thrust, about one speed of all rotors (theory, eq.
    (2.45)).
    """

    thrust: tuple[PerRotor, ...] = ()  # of each rotor
    torque: tuple[PerRotor, ...] = ()  # [m] gain of each rotor's torque


class Rotors(NamedTuple):
    """State of the rotors after the evaluation of the motors."""

    thrust: PerRotor  # [N]
    torque: PerRotor  # [N m]
    acceleration: PerRotor  # [rad/s^2]
    current: PerRotor  # [A] of each motor
    voltage: PerRotor  # [V] commanded for each controller
    power: PerRotor  # [W] taken by each motor and its controller


class EffectInputs(NamedTuple):
    """Inputs of an effect."""

    t: float  # [s] simulation time
    motion: Motion
    R_world_body: Mat3
    body: Any  # AnyMassProperties
    layout: Any  # RotorLayout, see lapwing/dynamics/vehicles/multirotor_equations.py
    air: Air
    air_rate_body: Vec3  # [rad/s] rotation of the air, body coordinates
