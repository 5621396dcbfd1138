"""Blade flapping: rotor discs tilt away from a transverse wind."""

import math
from typing import Annotated, NamedTuple

from annotated_types import Ge, Le

from lapwing.dynamics.effects._axes import air_body, by_axis, places
from lapwing.dynamics.effects._from_scene import Airframe, reject, validate_table
from lapwing.dynamics.effects._hooks import wrench_body
from lapwing.dynamics.effects._rotor_sums import total_wrench
from lapwing.dynamics.vector import add, cross, dot, norm, pair, scale, subtract
from lapwing.dynamics.vehicles.propeller import thrust_coefficient
from lapwing.kernels import always_inline
from lapwing.kernels.codegen import map_tuple

FASTEST = 0.5  # advance ratio above which the tilt grows no more
SLOWEST = 1.0  # [rad/s] below which the tilt is that of this rotor speed


class Settings(NamedTuple):
    """Scene table."""

    coefficient: Annotated[float, Ge(0), Le(2)] | None = None  # [rad] tilt over advance ratio; by the propeller
    stiffness: Annotated[float, Ge(0), Le(1e3)] = 0.0  # [N m/rad] of a hub against the tilt of its disc


class RotorFlapping(NamedTuple):
    """Tilt of disc and thrust by a_1 = k mu / (1 - mu^2 / 2), mu = V / (w R) (theory, eq. (2.38)).

    A stiff hub transmits the tilt as a moment. k = 4 theta_t - 2 lambda for blades with ideal twist, at the inflow of
    hover. Source: Pounds, Mahony and Corke, Control Engineering Practice 18 (2010) 691; Leishman, section 4.
    Valid for advance ratios below 0.3. An `h_force` coefficient that includes flapping would count it twice.
    """

    coefficient: float  # [rad]
    stiffness: float  # [N m/rad]
    inverse_radius: float  # [1/m]

    @classmethod
    def from_scene(cls, table: dict, airframe: Airframe) -> "RotorFlapping":
        """Return the parameters of the airframe's propeller."""
        settings = validate_table(Settings, table)
        propeller = airframe.propeller or reject("the vehicle has no [propeller]")
        coefficient, radius = settings.coefficient, 0.5 * propeller.diameter
        if coefficient is None:
            # at the tip: geometric angle H / (2 pi R), inflow ratio v_h / (w R) = sqrt(T / (2 rho A)) / (w R)
            tip = propeller.pitch / (2.0 * math.pi * radius)
            inflow = math.sqrt(2.0 * thrust_coefficient(propeller) / math.pi) / math.pi
            coefficient = max(4.0 * tip - 2.0 * inflow, 0.0)
        return cls(coefficient, settings.stiffness, 1.0 / radius)


@always_inline
def _wrench(c, place, state):
    e, air, omega = c
    thrust, speed = state
    turning = cross(omega, place)
    rate = e.inverse_radius / max(speed, SLOWEST)
    ahead, aside = rate * (air[0] + turning[0]), rate * (air[1] + turning[1])  # advance ratios
    mu = math.sqrt(ahead * ahead + aside * aside)
    slower = FASTEST / mu if mu > FASTEST else 1.0
    ahead, aside, mu = slower * ahead, slower * aside, slower * mu
    tilt = e.coefficient / (1.0 - 0.5 * mu * mu)
    a, b = tilt * ahead, tilt * aside  # [rad] to the back, along x and y
    force = (-thrust * a, -thrust * b, 0.0)
    moment = cross(place, force)
    return force, (moment[0] + e.stiffness * b, moment[1] - e.stiffness * a, moment[2])


@always_inline
def _wrench_tilted(c, at, state):
    e, air, omega = c
    place, axis = at
    thrust, speed = state
    v = add(air, cross(omega, place))
    ratio = scale(e.inverse_radius / max(speed, SLOWEST), subtract(v, scale(dot(axis, v), axis)))  # advance ratio
    mu = norm(ratio)
    slower = FASTEST / mu if mu > FASTEST else 1.0
    mu = slower * mu
    back = scale(slower * e.coefficient / (1.0 - 0.5 * mu * mu), ratio)  # [rad] of the disc, across the axis
    force = scale(-thrust, back)
    return force, subtract(cross(place, force), scale(e.stiffness, cross(axis, back)))


@always_inline
def _along_z(arguments):
    e, s, states = arguments
    air, omega = air_body(s)
    return total_wrench(map_tuple(_wrench, (e, air, omega), places(s.layout), states))


@always_inline
def _along_axes(arguments):
    e, s, states = arguments
    air, omega = air_body(s)
    at = map_tuple(pair, 0.0, places(s.layout), s.layout.axis)
    return total_wrench(map_tuple(_wrench_tilted, (e, air, omega), at, states))


@wrench_body(RotorFlapping)
def rotor_flapping(e, memory, s, rotors):
    """Return the force [N] and torque [N m] in body coordinates."""
    states = map_tuple(pair, 0.0, rotors.thrust, s.motion.rotor_speed)
    return by_axis(_along_z, _along_axes, s.layout.axis, (e, s, states))
