"""Multirotor with a point mass on a massless cable, under the effects of its scene (theory, section 1.5).

A formulation of the multirotor. The cable is a spring with a damper that can only pull. The force when it becomes taut
is bounded by its stiffness, while a rigid cable would need an impulse. Cables of steel or aramid are elastic, too;
their frequency limits the step. While the cable can become taut or slack, or the load touches the ground, steps are
under error control as in ground contact.
"""

import math
from typing import TYPE_CHECKING, Any, NamedTuple

from lapwing.dynamics.effects import _hooks as hooks
from lapwing.dynamics.effects._types import Motion
from lapwing.dynamics.lie.quaternion import rotate, rotation_matrix
from lapwing.dynamics.terrain import surface
from lapwing.dynamics.vector import ZERO, Vec3, add, apply, apply_transposed, cross, dot, norm, scale, subtract
from lapwing.dynamics.vehicles import multirotor
from lapwing.dynamics.vehicles.multirotor_equations import (
    FORMULATIONS,
    Formulation,
    MultirotorParameters,
    MultirotorState,
    evaluate,
)
from lapwing.dynamics.vehicles.newton_euler import newton_euler
from lapwing.kernels import always_inline, kernel

if TYPE_CHECKING:  # services do not import pydantic
    from lapwing.dynamics.vehicles.airframe import Airframe

GROUND_FREQUENCY, GROUND_DAMPING = 100.0, 0.7  # [rad/s] frequency and damping ratio of the load on the ground
CLEARANCE = 1e-3  # [m] height above the ground beyond which a load does not touch it within a step
SLIDING, FRICTION = 0.05, 0.6  # [m/s] speed above which friction has its full coefficient


class Sling(NamedTuple):
    """Cable and load."""

    load_mass: float  # [kg]
    length: float  # [m] length of the cable without tension
    stiffness: float  # [N/m]
    damping: float  # [N s/m]
    hook_body: Vec3  # [m] attachment of the cable, body
    drag_area: float  # [m^2] of the load, drag coefficient times area
    terrain: Any  # terrain under the load


class SlungMotion(NamedTuple):
    """State of vehicle and load; world frame ENU."""

    vehicle: Motion
    load_position: Vec3  # [m]
    load_velocity: Vec3  # [m/s]


@always_inline
def motion_of(layout, x):
    """Return the Motion of the vehicle."""
    return x.vehicle


@always_inline
def tension(sling, away, speed_away):
    """Return (force [N] on the hook towards the load, length [m]); zero while the cable is slack.

    Args:
        sling: Sling.
        away: vector from hook to load [m].
        speed_away: its rate of change [m/s].
    """
    distance = norm(away)
    stretch = distance - sling.length
    if stretch <= 0.0:
        return (0.0, 0.0, 0.0), distance
    pull = sling.stiffness * stretch + sling.damping * dot(away, speed_away) / distance
    return scale(max(pull, 0.0) / distance, away), distance


@always_inline
def cable(sling, R_world_body, x):
    """Return (world force [N], body torque [N m]) on the vehicle."""
    v = x.vehicle
    arm = apply(R_world_body, sling.hook_body)
    turning = apply(R_world_body, cross(v.omega_body, sling.hook_body))
    away = subtract(x.load_position, add(v.position_world, arm))
    force, _ = tension(sling, away, subtract(x.load_velocity, add(v.velocity_world, turning)))
    return force, cross(sling.hook_body, apply_transposed(R_world_body, force))


@always_inline
def ground(sling, position, velocity):
    """Return the force [N] of the ground on the load: spring and damper that do not pull, and Coulomb friction."""
    height, normal = surface(sling.terrain, position[0], position[1])
    depth = (height - position[2]) * normal[2]
    if depth <= 0.0:
        return (0.0, 0.0, 0.0)
    m, w = sling.load_mass, GROUND_FREQUENCY
    rising = dot(velocity, normal)
    press = max(m * w * (w * depth - 2.0 * GROUND_DAMPING * rising), 0.0)
    sliding = subtract(velocity, scale(rising, normal))
    return subtract(scale(press, normal), scale(FRICTION * press / max(norm(sliding), SLIDING), sliding))


@always_inline
def load_acceleration(sling, field, air, pull, x):
    """Return the acceleration [m/s^2] of the load under the cable force `pull` [N]."""
    wind = subtract(air.wind_world, x.load_velocity)
    drag = scale(0.5 * air.density * sling.drag_area * norm(wind), wind)
    force = add(subtract(drag, pull), ground(sling, x.load_position, x.load_velocity))
    return add(field, scale(1.0 / sling.load_mass, force))


@kernel
def rate(u, t, x):
    """Return the tangent of vehicle and load (theory, eqs. (1.20) to (1.22))."""
    sling = u.parameters.layout.bodies
    s, rotors, force, torque = evaluate(u, t, x.vehicle)
    pull, turn = cable(sling, s.R_world_body, x)
    field = hooks.all_fields(u.parameters.effects, u.memory, ZERO)
    linear, angular = newton_euler(s.body, u, s, add(force, pull), add(torque, turn))
    v = x.vehicle
    tangent = Motion(v.velocity_world, v.omega_body, linear, angular, rotors.acceleration)
    return SlungMotion(tangent, x.load_velocity, load_acceleration(sling, field, s.air, pull, x))


@always_inline
def _itself(_, x):
    return x


@kernel
def accelerations(u, t, x):
    """Return (linear [m/s^2] in the world, angular [rad/s^2] in the body) of the vehicle."""
    tangent = rate(u, t, x)
    return tangent.vehicle.velocity_world, tangent.vehicle.omega_body


@always_inline
def slackens(sling, away, speed_away, h):
    """Return True unless the cable stays taut for h [s]. See `tension` for other arguments."""
    distance = norm(away)
    reach = 2.0 * abs(dot(away, speed_away)) / max(distance, sling.length)
    return distance - sling.length <= reach * (h + sling.damping / sling.stiffness)


@always_inline
def lands(sling, position, velocity, h):
    """Return True unless the load stays off the ground for h [s]."""
    height, _ = surface(sling.terrain, position[0], position[1])
    return position[2] - height <= 2.0 * norm(velocity) * h + CLEARANCE


@always_inline
def cable_slackens(sling, R_world_body, x, h):
    """Return True unless the cable between vehicle and load stays taut for h [s]."""
    v = x.vehicle
    away = subtract(x.load_position, add(v.position_world, apply(R_world_body, sling.hook_body)))
    hook_velocity = add(v.velocity_world, apply(R_world_body, cross(v.omega_body, sling.hook_body)))
    return slackens(sling, away, subtract(x.load_velocity, hook_velocity), h)


@always_inline
def switches(layout, x, h):
    """Return True unless the cable stays taut and the load off the ground for h [s]."""
    sling = layout.bodies
    slack = cable_slackens(sling, rotation_matrix(x.vehicle.attitude), x, h)
    return slack or lands(sling, x.load_position, x.load_velocity, h)


FORMULATIONS[SlungMotion] = Formulation(motion_of, rate, _itself, accelerations, switches)


@always_inline
def cable_force(layout, x):
    """Return the force [N] in the world of the cable on the load."""
    force, _ = cable(layout.bodies, rotation_matrix(x.vehicle.attitude), x)
    return scale(-1.0, force)


def frequency(sling: Sling, mass: float) -> float:
    """Return the natural frequency [rad/s] of the load on the taut cable against a vehicle of a mass [kg]."""
    return math.sqrt(sling.stiffness * (1.0 / sling.load_mass + 1.0 / mass))


def parameters(airframe: "Airframe", sling: Sling, effects: tuple = ()) -> MultirotorParameters:
    """Return the plant's parameters. See `multirotor.parameters`."""
    p = multirotor.parameters(airframe, effects)
    return p._replace(layout=p.layout._replace(bodies=sling))


def initial_state(p: MultirotorParameters, *start: Any, **named: Any) -> MultirotorState:
    """Return a state with the load at rest below the hook or on the ground there; see `multirotor.initial_state`."""
    plain = multirotor.initial_state(p, *start, **named)
    v, sling = plain.motion, p.layout.bodies
    x, y, z = (float(c) for c in add(v.position_world, rotate(v.attitude, sling.hook_body)))
    load = (x, y, max(z - sling.length, surface(sling.terrain, x, y)[0]))
    return plain._replace(motion=SlungMotion(v, load, v.velocity_world))
