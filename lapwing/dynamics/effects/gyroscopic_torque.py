"""Gyroscopic torque of the rotors on the rotating body."""

from typing import NamedTuple

from lapwing.dynamics.effects._axes import by_axis
from lapwing.dynamics.effects._from_scene import Airframe, validate_table
from lapwing.dynamics.effects._hooks import torque
from lapwing.dynamics.effects._rotor_sums import total, total_vector
from lapwing.dynamics.vector import cross, product, scale, subtract
from lapwing.kernels import always_inline
from lapwing.kernels.codegen import map_tuple


class Settings(NamedTuple):
    """No keys: the parameters are in the airframe's [rotors]."""


class GyroscopicTorque(NamedTuple):
    """Gyroscopic torque and spin-up reaction of the rotors (theory, eq. (2.6)).

    Source: Euler's equations of a body with rotors that spin about axes fixed in it; the propeller's inertia is
    averaged over a revolution. Valid while the rotors spin much faster than the body.
    """

    inertia: float  # [kg m^2] of one rotor about its axis

    @classmethod
    def from_scene(cls, table: dict, airframe: Airframe) -> "GyroscopicTorque":
        """Return the parameters of the airframe's rotors."""
        validate_table(Settings, table)
        return cls(airframe.rotors.inertia)


@always_inline
def _along_z(arguments):
    e, s, rotors = arguments
    sign, omega = s.layout.reaction_sign, s.motion.omega_body
    # a rotor that accelerates the body about +z spins about -z
    momentum = -e.inertia * total(map_tuple(product, 0.0, sign, s.motion.rotor_speed))  # along body z
    spin_up = e.inertia * total(map_tuple(product, 0.0, sign, rotors.acceleration))
    return (-omega[1] * momentum, omega[0] * momentum, spin_up)


@always_inline
def _scale_axis(_, value, axis):
    return scale(value, axis)


@always_inline
def _sum_along(axis, sign, values):
    """Return the sum of a value of each rotor along its axis, with the sign of its reaction."""
    return total_vector(map_tuple(_scale_axis, 0.0, map_tuple(product, 0.0, sign, values), axis))


@always_inline
def _along_axes(arguments):
    e, s, rotors = arguments
    sign, axis = s.layout.reaction_sign, s.layout.axis
    momentum = scale(-e.inertia, _sum_along(axis, sign, s.motion.rotor_speed))
    spin_up = scale(e.inertia, _sum_along(axis, sign, rotors.acceleration))
    return subtract(spin_up, cross(s.motion.omega_body, momentum))


@torque(GyroscopicTorque)
def gyroscopic_torque(e, memory, s, rotors):
    """Return the torque [N m] in body coordinates."""
    return by_axis(_along_z, _along_axes, s.layout.axis, (e, s, rotors))
