"""Air drag of the fuselage."""

from typing import Annotated, NamedTuple

from annotated_types import Ge, Le

from lapwing.dynamics.effects._from_scene import Airframe, reject, validate_table
from lapwing.dynamics.effects._hooks import decay_rate, wrench_body
from lapwing.dynamics.vector import NOTHING, Vec3, apply_transposed, multiply, norm, scale, subtract

Coefficient = Annotated[float, Ge(0), Le(100)]
DENSEST, FASTEST_WIND = 1.5, 60.0  # [kg/m^3] air and [m/s] wind, for the bound of the damping
Triple = tuple[Coefficient, Coefficient, Coefficient]


class Settings(NamedTuple):
    """Scene table."""

    area: Triple | None = None  # [m^2] drag coefficient times area along body x, y, z; the airframe's if left out
    linear: Triple = (0.0, 0.0, 0.0)  # [N s/m] along body x, y, z


class BodyDrag(NamedTuple):
    """Linear and quadratic drag at the centre of mass, each axis with its own coefficients (theory, eq. (2.7)).

    Source: dimensional analysis; drag coefficient times area from the airframe. Valid for low Mach numbers and
    Reynolds numbers at which the drag coefficients are constant.
    """

    half_area: Vec3  # [m^2] half of drag coefficient times area
    linear: Vec3  # [N s/m]

    @classmethod
    def from_scene(cls, table: dict, airframe: Airframe) -> "BodyDrag":
        """Return the parameters with the airframe's areas, unless the table has others."""
        settings = validate_table(Settings, table)
        area = settings.area
        if area is None:
            area = airframe.drag.area if airframe.drag else reject("needs the key area: the vehicle has no [drag]")
        x, y, z = area
        return cls((0.5 * x, 0.5 * y, 0.5 * z), settings.linear)


@wrench_body(BodyDrag)
def body_drag(e, memory, s, rotors):
    """Return the force [N] and torque [N m] in body coordinates."""
    v_body = apply_transposed(s.R_world_body, subtract(s.motion.velocity_world, s.air.wind_world))
    pressure = s.air.density * norm(v_body)
    coefficient = (
        e.linear[0] + pressure * e.half_area[0],
        e.linear[1] + pressure * e.half_area[1],
        e.linear[2] + pressure * e.half_area[2],
    )
    return scale(-1.0, multiply(coefficient, v_body)), NOTHING


@decay_rate(BodyDrag)
def rate(e, memory, motion, body, layout):
    """Return a bound of the rate [1/s] at which drag changes the velocity."""
    pressure = 2.0 * DENSEST * (norm(motion.velocity_world) + FASTEST_WIND)
    areas, linear = e.half_area, e.linear
    largest = pressure * max(max(areas[0], areas[1]), areas[2]) + max(max(linear[0], linear[1]), linear[2])
    return largest * body.inverse_mass
