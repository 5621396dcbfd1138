"""Self-unloading crate: a pack on driven rollers, a door on a spring, the ground.

The pack is a rigid box with six degrees of freedom, the door turns about its lower edge (theory, chapter 9). The
hinge is the origin of the crate's frame: x outward along the tilted floor, y along the hinge, z away from the floor.
The source is Pappalardo et al. 2023, sections 3.6, 3.7 and 6.2, which defines the spring; the sizes are chosen.
"""

from typing import NamedTuple

from lapwing.dynamics.integrators import BREAKPOINTS, RATES
from lapwing.dynamics.lie.quaternion import Quaternion, exp
from lapwing.dynamics.vector import Vec3, add, apply_transposed, cross, divide, dot, multiply, scale, subtract
from lapwing.kernels import always_inline, kernel, math
from lapwing.kernels.codegen import map_index
from lapwing.papers.unloading.unloading_contact_points import CORNERS, ROLLERS, SIDES, Y, contacts, frames

LIFT_SPEED, GRIP = 0.5, 0.02  # [m/s] speed at which the pack is lifted, [s] acceleration time of the lift
Surface = tuple[float, float, float, float]  # stiffness [N/m], damping [N s/m], static and dynamic friction


class UnloadingParameters(NamedTuple):
    """Parameters of crate and pack; SI units."""

    pack_mass: float  # [kg]
    pack_half: Vec3  # [m] half length, width and height of the pack
    pack_inertia: Vec3  # [kg m^2]
    tilt: float  # [rad] tilt of the crate's floor, down towards the door
    floor_height: float  # [m] height of the hinge above the ground
    depth: float  # [m] from the hinge to the rear wall
    half_width: float  # [m] from the centre plane to a side wall
    roller_radius: float  # [m]
    roller_spacing: float  # [m] distance of two axes; the first axis is half of it behind the hinge
    roller_speed: float  # [rad/s] roller speed at the end of the ramp
    ramp_start: float  # [s] time at which the rollers start and the door is unlocked
    ramp_duration: float  # [s]
    door_length: float  # [m]
    door_mass: float  # [kg]
    door_spring: float  # [N m/rad]
    door_preload: float  # [rad] preload of the spring with the door shut
    door_damping: float  # [N m s/rad]
    door_lock: float  # [N m/rad] of the lock and of the stop
    edge_radius: float  # [m] radius of the hinge's and the door's edges
    pickup: float  # [s] time at which the pack is lifted
    gravity: float  # [m/s^2]
    on_rollers: Surface
    on_door: Surface
    on_ground: Surface


class UnloadingState(NamedTuple):
    """State of pack and door; world frame, z = 0 is the ground, y the direction of the hinge."""

    position_world: Vec3  # [m] centre of the pack
    attitude: Quaternion  # attitude of the pack
    velocity_world: Vec3  # [m/s]
    omega_body: Vec3  # [rad/s]
    door: tuple[float, float]  # angle from shut [rad], rate [rad/s]
    on_rollers: tuple[Vec3, ...]  # bristles [m]: two on each roller, then two on the hinge's edge
    on_door: tuple[Vec3, ...]  # eight corners, then two on the door's outer edge
    on_ground: tuple[Vec3, ...]  # eight corners


@always_inline
def _wrench(touches, x):
    """Return the sum of the forces [N] and of their torques about the pack's centre [N m], world frame."""
    force, torque = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for one in touches:
        force = add(force, one.force)
        torque = add(torque, cross(subtract(one.place, x.position_world), one.force))
    return force, torque


@always_inline
def _sum(a, b):
    return add(a[0], b[0]), add(a[1], b[1])


@always_inline
def door_acceleration(p, t, x, f, on_pack):
    """Return the angular acceleration of the door [rad/s^2] under the pack's reaction `on_pack` (eq. (9.9))."""
    angle, rate = x.door
    push = 0.0
    for one in on_pack:
        # virtual work of the reaction at its point, where the door's material moves along inward x lever
        push += dot(one.force, cross(Y, subtract(one.place, f.hinge)))
    weight = 0.5 * p.door_mass * p.gravity * p.door_length * f.inward[2]
    spring = -p.door_spring * (angle + p.door_preload) - p.door_damping * rate
    if angle < 0.0 or t < p.ramp_start:
        spring -= p.door_lock * angle + 0.01 * p.door_lock * rate
    below = -(f.hinge[2] + p.door_length * f.along_door[2])
    ground = 0.0
    if below > 0.0:
        upward = -p.door_length * f.inward[2]  # of the outer edge over the angle
        ground = max(p.on_ground[0] * below - p.on_ground[1] * upward * rate, 0.0) * upward
    return (weight + spring + ground - push) * 3.0 / (p.door_mass * p.door_length * p.door_length)


@always_inline
def _bristle_rate(touches, i):
    return touches[i].bristle_rate


@kernel
def rate(p, t, x):
    """Return the tangent: Newton and Euler for the pack, door equation, bristles (theory, eqs. (9.3) to (9.9))."""
    f = frames(p, t, x)
    result = contacts(p, t, x)
    o, v = x.omega_body, x.velocity_world
    if t < p.pickup:
        force, torque = _sum(_sum(_wrench(result.rollers, x), _wrench(result.door, x)), _wrench(result.ground, x))
        force, torque = _sum((force, torque), _wrench(result.walls, x))
        acceleration = add(scale(1.0 / p.pack_mass, force), (0.0, 0.0, -p.gravity))
        spin = apply_transposed(f.pack, torque)
        angular = divide(add(spin, cross(multiply(p.pack_inertia, o), o)), p.pack_inertia)
    else:
        acceleration = scale(1.0 / GRIP, subtract((0.0, 0.0, LIFT_SPEED), v))
        angular = scale(-1.0 / GRIP, o)
    return UnloadingState(
        v,
        o,
        acceleration,
        angular,
        (x.door[1], door_acceleration(p, t, x, f, result.door)),
        map_index(_bristle_rate, x.on_rollers, result.rollers),
        map_index(_bristle_rate, x.on_door, result.door),
        map_index(_bristle_rate, x.on_ground, result.ground),
    )


RATES[UnloadingParameters] = rate


@always_inline
def _next_breakpoint(p, t):
    """Return the next time [s] at which the rollers start or reach their speed, or the pack is lifted."""
    first = math.inf
    for time in (p.ramp_start, p.ramp_start + p.ramp_duration, p.pickup):
        if t < time < first:
            first = time
    return first


BREAKPOINTS[UnloadingParameters] = _next_breakpoint


def initial_state(p: UnloadingParameters, gap: float = 0.01) -> UnloadingState:
    """Return the pack at rest on the rollers, its front `gap` [m] behind the closed door."""
    none = (0.0, 0.0, 0.0)
    s, c = math.sincos(p.tilt)
    back, up = gap + p.pack_half[0], 2.0 * p.roller_radius + p.pack_half[2]
    position = (up * s - back * c, 0.0, p.floor_height + back * s + up * c)
    return UnloadingState(
        position,
        exp((0.0, p.tilt, 0.0)),
        none,
        none,
        (0.0, 0.0),
        (none,) * (2 * ROLLERS + len(SIDES)),
        (none,) * (CORNERS + len(SIDES)),
        (none,) * CORNERS,
    )


@always_inline
def _force(touches, i):
    return touches[i].force


@kernel
def forces_on_pack(p, t, x):
    """Return world forces [N]: (at the ten points on rollers and hinge, of the door, of the ground, of the walls)."""
    result = contacts(p, t, x)
    rollers = map_index(_force, x.on_rollers, result.rollers)
    return rollers, _wrench(result.door, x)[0], _wrench(result.ground, x)[0], _wrench(result.walls, x)[0]
