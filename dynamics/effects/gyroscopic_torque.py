"""Gyroscopic torque of the spinning rotors on the turning body."""

from typing import TYPE_CHECKING, NamedTuple

from dynamics.effects._hooks import torque
from dynamics.effects._rotors import total
from dynamics.effects._scene import checked
from dynamics.generate import each
from dynamics.kernel import leaf

if TYPE_CHECKING:  # a process that flies has no need of pydantic
    from dynamics.vehicles.airframe import Airframe


class Settings(NamedTuple):
    """No keys: the airframe's [rotors] says it all."""


class GyroscopicTorque(NamedTuple):
    """Gyroscopic torque and spin-up reaction of the rotors (theory.md, eq. (2.6)).

    Source: Euler's equations of a body with rotors that spin about its z axis; the propeller's inertia is averaged over
    a turn. Valid while the rotors turn many times faster than the body.
    """

    inertia: float  # [kg m^2] of one rotor about its axis

    @classmethod
    def from_scene(cls, table: dict, airframe: "Airframe") -> "GyroscopicTorque":
        """From the airframe's rotors."""
        checked(Settings, table)
        return cls(airframe.rotors.inertia)


@leaf
def _signed(_, sign, value):
    return sign * value


@torque(GyroscopicTorque)
def gyroscopic_torque(e, memory, s, rotors):
    """Torque [N m] in body coordinates."""
    sign, omega = s.layout.reaction_sign, s.motion.omega_body
    # a rotor that pushes the body to +z turns about -z itself
    momentum = -e.inertia * total(each(_signed, 0.0, sign, s.motion.rotor_speed))  # along body z
    spin_up = e.inertia * total(each(_signed, 0.0, sign, rotors.acceleration))
    return (-omega[1] * momentum, omega[0] * momentum, spin_up)
