"""Aerodynamic damping of the vehicle's rotation."""

from typing import Annotated, NamedTuple

from annotated_types import Ge, Le

from lapwing.dynamics.effects._from_scene import Airframe, validate_table
from lapwing.dynamics.effects._hooks import decay_rate, torque
from lapwing.dynamics.vector import Vec3, multiply, scale, subtract

Coefficient = Annotated[float, Ge(0), Le(1e3)]


class Settings(NamedTuple):
    """Keys of the scene's table."""

    linear: tuple[Coefficient, Coefficient, Coefficient]  # [N m s/rad] about body x, y, z


class RotationalDrag(NamedTuple):
    """Torque -c omega about each body axis, relative to the air (theory, eq. (2.66)).

    It lumps the damping of the rotors, whose inflow changes as the vehicle rolls and pitches, and of the fuselage.
    Source: the damping derivatives L_p, M_q, N_r of flight mechanics; identified from flights. Valid for rates at
    which the change of inflow is small compared with the induced velocity. Adds to the damping of `axial_inflow`.
    """

    linear: Vec3  # [N m s/rad]

    @classmethod
    def from_scene(cls, table: dict, airframe: Airframe) -> "RotationalDrag":
        """Take the coefficients from the scene's table."""
        return cls(validate_table(Settings, table).linear)


@torque(RotationalDrag)
def rotational_drag(e, memory, s, rotors):
    """Return the torque [N m] in body coordinates."""
    return scale(-1.0, multiply(e.linear, subtract(s.motion.omega_body, s.air_rate_body)))


@decay_rate(RotationalDrag)
def rate(e, memory, motion, body, layout):
    """Return a bound of the rate [1/s] at which drag changes the body rates."""
    size = 0.0
    for element in body.inverse_inertia:
        size += abs(element)
    return size * max(max(e.linear[0], e.linear[1]), e.linear[2])
