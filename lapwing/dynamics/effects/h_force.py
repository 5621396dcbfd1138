"""H-force: drag of the rotors in their plane."""

from typing import Annotated, NamedTuple

from annotated_types import Ge, Le

from lapwing.dynamics.effects._axes import air_body, by_axis, places
from lapwing.dynamics.effects._from_scene import Airframe, reject, validate_table
from lapwing.dynamics.effects._hooks import wrench_body
from lapwing.dynamics.effects._rotor_sums import total, total_wrench
from lapwing.dynamics.vector import add, cross, dot, pair, product, scale, subtract
from lapwing.dynamics.vehicles.propeller import h_force_coefficient
from lapwing.kernels import always_inline
from lapwing.kernels.codegen import map_tuple


class Settings(NamedTuple):
    """Scene table."""

    coefficient: Annotated[float, Ge(0), Le(1)] | None = None  # [m^3/rad]; from the propeller if left out


class HForce(NamedTuple):
    """Force -rho c w v on each rotor, across its axis, from the rotor's speed w and its velocity v (theory, eq.
    (2.11)).

    Source: the H-force of blade-element theory, C_H = sigma c_d mu / 4 (Leishman, Principles of Helicopter
    Aerodynamics, section 5), lumped with flapping by a given coefficient: Martin and Salaun, ICRA 2010. Valid for
    advance ratios below 0.2.
    """

    coefficient: float  # [m^3/rad]
    height: float  # [m] height of all rotors over the centre of mass; not used for tilted rotors
    square_arm: tuple[float, ...]  # [m^2] squared distance of each rotor from the body z axis

    @classmethod
    def from_scene(cls, table: dict, airframe: Airframe) -> "HForce":
        """Return the parameters of the airframe's propeller, unless the table has the coefficient."""
        settings = validate_table(Settings, table)
        positions = airframe.rotors.position
        if len({z for _, _, z in positions}) > 1 and not airframe.rotors.tilted_axis:
            reject("needs rotors at one height")
        coefficient = settings.coefficient
        if coefficient is None:
            propeller = airframe.propeller or reject("needs the key coefficient: the vehicle has no [propeller]")
            coefficient = h_force_coefficient(propeller)
        return cls(coefficient, positions[0][2], tuple(x * x + y * y for x, y, _ in positions))


@always_inline
def _along_z(arguments):
    e, s = arguments
    layout, speed = s.layout, s.motion.rotor_speed
    v, omega = air_body(s)
    # sums over the rotors of speed times 1, x, y and x^2 + y^2 give the force and torque of all of them
    k, h = e.coefficient * s.air.density, e.height
    w = k * total(speed)
    wx = k * total(map_tuple(product, 0.0, speed, layout.x_body))
    wy = k * total(map_tuple(product, 0.0, speed, layout.y_body))
    w_square = k * total(map_tuple(product, 0.0, speed, e.square_arm))
    x = -(w * (v[0] + h * omega[1]) - wy * omega[2])
    y = -(w * (v[1] - h * omega[0]) + wx * omega[2])
    yaw = wy * (v[0] + h * omega[1]) - wx * (v[1] - h * omega[0]) - w_square * omega[2]
    return (x, y, 0.0), (-h * y, h * x, yaw)


@always_inline
def _of_rotor(c, speed, at):
    k, air, omega = c
    place, axis = at
    v = add(air, cross(omega, place))
    force = scale(-k * speed, subtract(v, scale(dot(axis, v), axis)))
    return force, cross(place, force)


@always_inline
def _along_axes(arguments):
    e, s = arguments
    air, omega = air_body(s)
    at = map_tuple(pair, 0.0, places(s.layout), s.layout.axis)
    return total_wrench(map_tuple(_of_rotor, (e.coefficient * s.air.density, air, omega), s.motion.rotor_speed, at))


@wrench_body(HForce)
def h_force(e, memory, s, rotors):
    """Return the force [N] and torque [N m] in body coordinates."""
    return by_axis(_along_z, _along_axes, s.layout.axis, (e, s))
