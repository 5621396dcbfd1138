"""H-force: drag of the turning rotors in their plane."""

from typing import TYPE_CHECKING, Annotated, NamedTuple

from annotated_types import Ge, Le

from dynamics.effects._hooks import wrench_body
from dynamics.effects._rotors import total
from dynamics.effects._scene import cannot, checked
from dynamics.generate import each
from dynamics.kernel import leaf
from dynamics.vector import apply_transposed, subtract
from dynamics.vehicles.propeller import drag_coefficients

if TYPE_CHECKING:  # a process that flies has no need of pydantic
    from dynamics.vehicles.airframe import Airframe


class Settings(NamedTuple):
    """What a scene says."""

    coefficient: Annotated[float, Ge(0), Le(1)] | None = None  # [m^3/rad]; from the propeller if left out


class HForce(NamedTuple):
    """Force -rho c w v on each rotor, across its axis, from the rotor's speed w and its velocity v (theory.md, eq.
    (2.11)).

    Source: the H-force of blade-element theory, C_H = sigma c_d mu / 4 (Leishman, Principles of Helicopter
    Aerodynamics, section 5), lumped with flapping by a given coefficient: Martin and Salaun, ICRA 2010. Valid for
    advance ratios below 0.2.
    """

    coefficient: float  # [m^3/rad]
    height: float  # [m] of all rotors over the centre of mass
    square_arm: tuple[float, ...]  # [m^2] squared distance of each rotor from the body z axis

    @classmethod
    def from_scene(cls, table: dict, airframe: "Airframe") -> "HForce":
        """From the airframe's propeller unless the table has the coefficient."""
        given = checked(Settings, table)
        positions = airframe.rotors.position
        if len({z for _, _, z in positions}) > 1:
            cannot("the rotors must all be at one height")
        coefficient = given.coefficient
        if coefficient is None:
            propeller = airframe.propeller or cannot("needs the key coefficient: the vehicle has no [propeller]")
            radius = 0.5 * propeller.diameter
            blade_area = propeller.blades * radius * propeller.diameter / propeller.aspect_ratio
            coefficient = blade_area * sum(drag_coefficients(propeller)) * radius / 4.0
        return cls(coefficient, positions[0][2], tuple(x * x + y * y for x, y, _ in positions))


@leaf
def _product(_, a, b):
    return a * b


@wrench_body(HForce)
def h_force(e, memory, s, rotors):
    """Force [N] and torque [N m] in body coordinates."""
    layout, omega, speed = s.layout, s.motion.omega_body, s.motion.rotor_speed
    v = apply_transposed(s.R_world_body, subtract(s.motion.velocity_world, s.air.wind_world))
    # sums over the rotors of speed times 1, x, y and x^2 + y^2 give the force and torque of all of them
    k, h = e.coefficient * s.air.density, e.height
    w = k * total(speed)
    wx = k * total(each(_product, 0.0, speed, layout.x_body))
    wy = k * total(each(_product, 0.0, speed, layout.y_body))
    w_square = k * total(each(_product, 0.0, speed, e.square_arm))
    x = -(w * (v[0] + h * omega[1]) - wy * omega[2])
    y = -(w * (v[1] - h * omega[0]) + wx * omega[2])
    yaw = wy * (v[0] + h * omega[1]) - wx * (v[1] - h * omega[0]) - w_square * omega[2]
    return (x, y, 0.0), (-h * y, h * x, yaw)
