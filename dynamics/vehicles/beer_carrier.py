"""The crate that unloads itself: a pack on driven rollers, a door on a spring, the ground.

The pack is a rigid box with six degrees of freedom, the door turns about its lower edge (theory.md, chapter 9). The
hinge is the origin of the crate's frame: x outward along the tilted floor, y along the hinge, z away from the floor.
The source is Pappalardo et al. 2023, sections 3.6, 3.7 and 6.2, which gives the spring; the sizes are ours.
"""

import math
from typing import NamedTuple

from dynamics.integrators import RATES
from dynamics.kernel import kernel, leaf
from dynamics.lie.quaternion import Quaternion, exp, rotation_matrix
from dynamics.unrolled import each
from dynamics.vector import Vec3, add, apply, apply_transposed, cross, divide, dot, multiply, norm, scale, subtract
from dynamics.vehicles.beer_contact import Touch, touch

ROLLERS, CORNERS = 4, 8
SIDES = (-0.8, 0.8)  # where along the pack's width it rests on a roller or an edge, of half its width
LIFT_SPEED, GRIP = 0.5, 0.02  # [m/s] at which somebody takes the pack up, [s] in which he gets it moving
Surface = tuple[float, float, float, float]  # stiffness [N/m], damping [N s/m], static and dynamic friction


class BeerCarrierParameters(NamedTuple):
    """SI units."""

    pack_mass: float  # [kg]
    pack_half: Vec3  # [m] half its length, width, height
    pack_inertia: Vec3  # [kg m^2]
    tilt: float  # [rad] of the crate's floor, down towards the door
    floor_height: float  # [m] of the hinge over the ground
    depth: float  # [m] from the hinge to the rear wall
    half_width: float  # [m] between the middle and a side wall
    roller_radius: float  # [m]
    roller_spacing: float  # [m] between two axes; the first is half of it behind the hinge
    roller_speed: float  # [rad/s] at the end of the ramp
    ramp_start: float  # [s] when the rollers start and the door is unlocked
    ramp_duration: float  # [s]
    door_length: float  # [m]
    door_mass: float  # [kg]
    door_spring: float  # [N m/rad]
    door_preload: float  # [rad] that the spring is wound up when the door is shut
    door_damping: float  # [N m s/rad]
    door_lock: float  # [N m/rad] of the lock and of the stop
    edge_radius: float  # [m] of the hinge's and the door's edges
    pickup: float  # [s] when somebody takes the pack away
    gravity: float  # [m/s^2]
    on_rollers: Surface
    on_door: Surface
    on_ground: Surface


class BeerCarrierState(NamedTuple):
    """World frame; z = 0 is the ground, y the direction of the hinge."""

    position_world: Vec3  # [m] of the pack's middle
    attitude: Quaternion  # of the pack
    velocity_world: Vec3  # [m/s]
    omega_body: Vec3  # [rad/s]
    door: tuple[float, float]  # angle from shut [rad], rate [rad/s]
    on_rollers: tuple[Vec3, ...]  # bristles [m]: two on each roller, then two on the hinge's edge
    on_door: tuple[Vec3, ...]  # eight corners, then two on the door's outer edge
    on_ground: tuple[Vec3, ...]  # eight corners


class Frames(NamedTuple):
    """What all contacts look at."""

    pack: tuple  # R_world_body
    spin_world: Vec3  # [rad/s] of the pack
    forward: Vec3  # x of the crate in the world
    upward: Vec3  # z of the crate in the world
    hinge: Vec3  # [m] world frame
    along_door: Vec3  # from the hinge outward in the door
    inward: Vec3  # normal of the door's inner face
    rolling: float  # [rad/s]


Y = (0.0, 1.0, 0.0)
SIGNS = tuple((float(a), float(b), float(c)) for a in (-1, 1) for b in (-1, 1) for c in (-1, 1))


@leaf
def roller_speed(p, t):
    """Speed of the rollers at time t [rad/s]: a ramp."""
    return p.roller_speed * min(max((t - p.ramp_start) / p.ramp_duration, 0.0), 1.0)


@leaf
def frames(p, t, x):
    """The frames of crate, door and pack at time t (theory.md, eqs. (9.1) and (9.2))."""
    c, s = math.cos(p.tilt), math.sin(p.tilt)
    forward, upward = (c, 0.0, -s), (s, 0.0, c)
    opened, shut = math.sin(x.door[0]), math.cos(x.door[0])
    along = add(scale(shut, upward), scale(opened, forward))
    inward = add(scale(opened, upward), scale(-shut, forward))
    pack = rotation_matrix(x.attitude)
    hinge = (0.0, 0.0, p.floor_height)
    return Frames(pack, apply(pack, x.omega_body), forward, upward, hinge, along, inward, roller_speed(p, t))


@leaf
def material_velocity(x, f, place):
    """Velocity of the pack's material at a place [m/s]."""
    return add(x.velocity_world, cross(f.spin_world, subtract(place, x.position_world)))


@leaf
def bar(p, x, f, surface, centre, radius, rolling, velocity, bristle):
    """Contact with a cylinder along y through `centre`, which turns at `rolling` [rad/s] (theory.md, eq. (9.7))."""
    h = p.pack_half
    q = apply_transposed(f.pack, subtract(centre, x.position_world))
    nearest = (min(max(q[0], -h[0]), h[0]), min(max(q[1], -h[1]), h[1]), min(max(q[2], -h[2]), h[2]))
    gap = subtract(nearest, q)
    distance = norm(gap)
    normal = apply(f.pack, scale(1.0 / max(distance, 1e-12), gap))
    place = add(x.position_world, apply(f.pack, nearest))
    own = add(velocity, scale(rolling, cross(Y, subtract(place, centre))))
    # an axis inside of the pack has no nearest face: the pack would be through
    depth = radius - distance if distance > 0.0 else 0.0
    return touch(surface, depth, normal, place, subtract(material_velocity(x, f, place), own), bristle)


@kernel
def roller_touch(p, x, f, i):
    """Contact i of the pack with the rollers (two each) and with the hinge's edge (two)."""
    sideways = scale(SIDES[i % 2] * p.pack_half[1], Y)
    if i < 2 * ROLLERS:
        behind = (i // 2 + 0.5) * p.roller_spacing
        centre = add(f.hinge, add(scale(-behind, f.forward), scale(p.roller_radius, f.upward)))
        radius, rolling = p.roller_radius, f.rolling
    else:
        centre = add(f.hinge, scale(-p.edge_radius, f.upward))
        radius, rolling = p.edge_radius, 0.0
    centre = (centre[0], x.position_world[1] + sideways[1], centre[2])
    return bar(p, x, f, p.on_rollers, centre, radius, rolling, (0.0, 0.0, 0.0), x.on_rollers[i])


@leaf
def corner(p, x, f, i):
    """Corner i of the pack in the world [m]."""
    return add(x.position_world, apply(f.pack, multiply(SIGNS[i], p.pack_half)))


@kernel
def door_touch(p, x, f, i):
    """Contact i of the pack with the door: eight corners on its inner face, and its outer edge on the pack twice."""
    if i >= CORNERS:
        centre = add(f.hinge, scale(p.door_length, f.along_door))
        centre = (centre[0], x.position_world[1] + SIDES[i - CORNERS] * p.pack_half[1], centre[2])
        moving = scale(-x.door[1] * p.door_length, f.inward)
        return bar(p, x, f, p.on_door, centre, p.edge_radius, 0.0, moving, x.on_door[i])
    place = corner(p, x, f, i)
    lever = subtract(place, f.hinge)
    reach, behind = dot(lever, f.along_door), -dot(lever, f.inward)
    # a corner further behind than this has come around the door, not through it
    inside = 0.0 < reach < p.door_length and behind < 0.02
    own = add(scale(-x.door[1] * reach, f.inward), scale(-x.door[1] * behind, f.along_door))
    relative = subtract(material_velocity(x, f, place), own)
    return touch(p.on_door, behind if inside else 0.0, f.inward, place, relative, x.on_door[i])


@kernel
def ground_touch(p, x, f, i):
    """Contact of corner i with the ground."""
    place = corner(p, x, f, i)
    return touch(p.on_ground, -place[2], (0.0, 0.0, 1.0), place, material_velocity(x, f, place), x.on_ground[i])


@kernel
def wall_touch(p, x, f, i):
    """Contact of corner i with the crate's walls, which are smooth: the rear one and the two at the sides."""
    place = corner(p, x, f, i)
    lever = subtract(place, f.hinge)
    velocity, nothing = material_velocity(x, f, place), (0.0, 0.0, 0.0)
    smooth = (p.on_rollers[0], p.on_rollers[1], 1e-9, 1e-9)
    deep = dot(lever, f.forward)
    rear = touch(smooth, -p.depth - deep, f.forward, place, velocity, nothing).force
    side = -1.0 if place[1] > 0.0 else 1.0
    over = abs(place[1]) - p.half_width if deep < 0.0 else 0.0
    beside = touch(smooth, over, (0.0, side, 0.0), place, velocity, nothing).force
    return Touch(add(rear, beside), place, nothing)


class Contacts(NamedTuple):
    """Every contact of the pack."""

    rollers: tuple[Touch, ...]
    door: tuple[Touch, ...]
    ground: tuple[Touch, ...]
    walls: tuple[Touch, ...]


@kernel
def contacts(p, t, x):
    """All contacts of the pack at time t."""
    f = frames(p, t, x)
    return Contacts(
        each(roller_touch, x.on_rollers, p, x, f),
        each(door_touch, x.on_door, p, x, f),
        each(ground_touch, x.on_ground, p, x, f),
        each(wall_touch, x.on_ground, p, x, f),
    )


@leaf
def _wrench(touches, x):
    """Sum of the forces [N] and of their torques about the pack's middle [N m], world frame."""
    force, torque = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for one in touches:
        force = add(force, one.force)
        torque = add(torque, cross(subtract(one.place, x.position_world), one.force))
    return force, torque


@leaf
def _sum(a, b):
    return add(a[0], b[0]), add(a[1], b[1])


@leaf
def door_acceleration(p, t, x, f, on_pack):
    """Angular acceleration of the door [rad/s^2] under the pack's reaction `on_pack` (theory.md, eq. (9.9))."""
    angle, rate = x.door
    push = 0.0
    for one in on_pack:
        # virtual work of the reaction at its place: the door's material there moves along inward x lever
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


@leaf
def _bristle_rate(touches, i):
    return touches[i].bristle_rate


@kernel
def rate(p, t, x):
    """Newton and Euler for the pack, the door's equation, and the bristles (theory.md, eqs. (9.3) to (9.9))."""
    f = frames(p, t, x)
    found = contacts(p, t, x)
    o, v = x.omega_body, x.velocity_world
    if t < p.pickup:
        force, torque = _sum(_sum(_wrench(found.rollers, x), _wrench(found.door, x)), _wrench(found.ground, x))
        force, torque = _sum((force, torque), _wrench(found.walls, x))
        acceleration = add(scale(1.0 / p.pack_mass, force), (0.0, 0.0, -p.gravity))
        spin = apply_transposed(f.pack, torque)
        angular = divide(add(spin, cross(multiply(p.pack_inertia, o), o)), p.pack_inertia)
    else:
        acceleration = scale(1.0 / GRIP, subtract((0.0, 0.0, LIFT_SPEED), v))
        angular = scale(-1.0 / GRIP, o)
    return BeerCarrierState(
        v,
        o,
        acceleration,
        angular,
        (x.door[1], door_acceleration(p, t, x, f, found.door)),
        each(_bristle_rate, x.on_rollers, found.rollers),
        each(_bristle_rate, x.on_door, found.door),
        each(_bristle_rate, x.on_ground, found.ground),
    )


RATES[BeerCarrierParameters] = rate


def initial_state(p: BeerCarrierParameters, gap: float = 0.01) -> BeerCarrierState:
    """At rest on the rollers, its front `gap` [m] behind the shut door."""
    none = (0.0, 0.0, 0.0)
    c, s = math.cos(p.tilt), math.sin(p.tilt)
    back, up = gap + p.pack_half[0], 2.0 * p.roller_radius + p.pack_half[2]
    position = (up * s - back * c, 0.0, p.floor_height + back * s + up * c)
    return BeerCarrierState(
        position,
        exp((0.0, p.tilt, 0.0)),
        none,
        none,
        (0.0, 0.0),
        (none,) * (2 * ROLLERS + len(SIDES)),
        (none,) * (CORNERS + len(SIDES)),
        (none,) * CORNERS,
    )


@leaf
def _force(touches, i):
    return touches[i].force


@kernel
def forces_on_pack(p, t, x):
    """World forces [N]: (at the ten places on rollers and hinge, of the door, of the ground, of the walls)."""
    found = contacts(p, t, x)
    rollers = each(_force, x.on_rollers, found.rollers)
    return rollers, _wrench(found.door, x)[0], _wrench(found.ground, x)[0], _wrench(found.walls, x)[0]


@kernel
def energy(p, t, x):
    """Kinetic and potential energy [J] of pack, door, its spring and the ground's and rollers' springs under them.

    Bristles, the door's stop and its edge on the ground are left out: it is an energy while the door is off both.
    """
    f = frames(p, t, x)
    o, v = x.omega_body, x.velocity_world
    inertia = p.door_mass * p.door_length * p.door_length / 3.0
    kinetic = 0.5 * (p.pack_mass * dot(v, v) + dot(o, multiply(p.pack_inertia, o)) + inertia * x.door[1] * x.door[1])
    height = f.hinge[2] + 0.5 * p.door_length * f.along_door[2]
    weight = p.gravity * (p.pack_mass * x.position_world[2] + p.door_mass * height)
    wound = x.door[0] + p.door_preload
    return kinetic + weight + 0.5 * p.door_spring * wound * wound
