"""Contacts of the pack: points, velocities and contact law (theory, section 9.3).

`p` is a UnloadingParameters, `x` a UnloadingState. The normal force is that of a spring and a damper that never pull;
friction is the model of Canudas de Wit, Olsson, Astrom and Lischinsky (IEEE Trans. Autom. Control 40 (1995) 419), whose
bristles carry a load at rest without creep (theory, eqs. (9.4) to (9.6)).
"""

from typing import NamedTuple

from lapwing.dynamics.lie.quaternion import rotation_matrix
from lapwing.dynamics.vector import Vec3, add, apply, apply_transposed, cross, dot, multiply, norm, scale, subtract
from lapwing.kernels import always_inline, kernel, math
from lapwing.kernels.codegen import map_index

STRIBECK_SPEED = 0.01  # [m/s] transition from static to dynamic friction
BRISTLE = 5.0e3  # [1/m] stiffness over the normal force: bristles bend 0.1 mm before they slide
BRISTLE_DAMPING = 45.0  # [s/m] damping over the normal force: critical for a body at rest under its weight
FASTEST = 4000.0  # [1/s] rate of the bristles; above the corresponding slip speed, friction is sliding friction


class Touch(NamedTuple):
    """Effect of one contact on the pack."""

    force: Vec3  # [N] world frame
    place: Vec3  # [m] world frame
    bristle_rate: Vec3  # [m/s]


@always_inline
def friction(friction_static, friction_dynamic, bristle, slip):
    """Return (friction force over the normal force, rate of the bristle [m/s]) at the velocity `slip` [m/s]."""
    speed = norm(slip)
    ratio = speed / STRIBECK_SPEED
    limit = friction_dynamic + (friction_static - friction_dynamic) * math.exp(-ratio * ratio)
    rate = subtract(slip, scale(min(BRISTLE * speed / limit, FASTEST), bristle))
    force = add(scale(-BRISTLE, bristle), scale(-BRISTLE_DAMPING, rate))
    over = norm(force)
    return (scale(limit / over, force) if over > limit else force), rate


@always_inline
def touch(surface, depth, normal, place, velocity, bristle):
    """Return the contact of the pack at a penetration depth.

    Args:
        surface: (stiffness [N/m], damping [N s/m], static friction, dynamic friction).
        depth: penetration [m]; not positive: no contact.
        normal: unit vector towards the pack.
        place: position of the contact [m].
        velocity: velocity of the pack's material there, relative to the other body [m/s].
        bristle: deflection of the bristles [m].
    """
    closing = -dot(velocity, normal)
    force = surface[0] * depth + surface[1] * closing if depth > 0.0 else 0.0
    if force <= 0.0:
        return Touch((0.0, 0.0, 0.0), place, scale(-0.1 * FASTEST, bristle))
    along, rate = friction(surface[2], surface[3], bristle, add(velocity, scale(closing, normal)))
    return Touch(add(scale(force, normal), scale(force, along)), place, rate)


ROLLERS, CORNERS = 4, 8
SIDES = (-0.8, 0.8)  # lateral position of the contacts with a roller or an edge, relative to half the pack's width
Y = (0.0, 1.0, 0.0)
SIGNS = tuple((float(a), float(b), float(c)) for a in (-1, 1) for b in (-1, 1) for c in (-1, 1))


class Frames(NamedTuple):
    """Frames shared by all contacts."""

    pack: tuple  # R_world_body
    spin_world: Vec3  # [rad/s] of the pack
    forward: Vec3  # x of the crate in the world
    upward: Vec3  # z of the crate in the world
    hinge: Vec3  # [m] world frame
    along_door: Vec3  # outward from the hinge in the door
    inward: Vec3  # normal of the door's inner face
    rolling: float  # [rad/s]


@always_inline
def roller_speed(p, t):
    """Return the roller speed at time t [rad/s]: a ramp."""
    return p.roller_speed * min(max((t - p.ramp_start) / p.ramp_duration, 0.0), 1.0)


@always_inline
def frames(p, t, x):
    """Return the frames of crate, door and pack at time t (theory, eqs. (9.1) and (9.2))."""
    s, c = math.sincos(p.tilt)
    forward, upward = (c, 0.0, -s), (s, 0.0, c)
    opened, shut = math.sincos(x.door[0])
    along = add(scale(shut, upward), scale(opened, forward))
    inward = add(scale(opened, upward), scale(-shut, forward))
    pack = rotation_matrix(x.attitude)
    hinge = (0.0, 0.0, p.floor_height)
    return Frames(pack, apply(pack, x.omega_body), forward, upward, hinge, along, inward, roller_speed(p, t))


@always_inline
def material_velocity(x, f, place):
    """Return the velocity of the pack's material at a place [m/s]."""
    return add(x.velocity_world, cross(f.spin_world, subtract(place, x.position_world)))


@always_inline
def bar(p, x, f, surface, centre, radius, rolling, velocity, bristle):
    """Return the contact with a cylinder along y through `centre`, rotating at `rolling` [rad/s] (eq. (9.7))."""
    h = p.pack_half
    q = apply_transposed(f.pack, subtract(centre, x.position_world))
    nearest = (min(max(q[0], -h[0]), h[0]), min(max(q[1], -h[1]), h[1]), min(max(q[2], -h[2]), h[2]))
    gap = subtract(nearest, q)
    distance = norm(gap)
    normal = apply(f.pack, scale(1.0 / max(distance, 1e-12), gap))
    place = add(x.position_world, apply(f.pack, nearest))
    own = add(velocity, scale(rolling, cross(Y, subtract(place, centre))))
    # an axis inside the pack has no nearest face: the pack would have passed through
    depth = radius - distance if distance > 0.0 else 0.0
    return touch(surface, depth, normal, place, subtract(material_velocity(x, f, place), own), bristle)


@kernel
def roller_touch(p, x, f, i):
    """Return contact i of the pack with the rollers (two each) and with the hinge's edge (two)."""
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


@always_inline
def corner(p, x, f, i):
    """Return corner i of the pack in the world [m]."""
    return add(x.position_world, apply(f.pack, multiply(SIGNS[i], p.pack_half)))


@kernel
def door_touch(p, x, f, i):
    """Return contact i of the pack with the door: eight corners on its inner face, two of its outer edge."""
    if i >= CORNERS:
        centre = add(f.hinge, scale(p.door_length, f.along_door))
        centre = (centre[0], x.position_world[1] + SIDES[i - CORNERS] * p.pack_half[1], centre[2])
        moving = scale(-x.door[1] * p.door_length, f.inward)
        return bar(p, x, f, p.on_door, centre, p.edge_radius, 0.0, moving, x.on_door[i])
    place = corner(p, x, f, i)
    lever = subtract(place, f.hinge)
    reach, behind = dot(lever, f.along_door), -dot(lever, f.inward)
    # a corner further behind has passed around the door, not through it
    inside = 0.0 < reach < p.door_length and behind < 0.02
    own = add(scale(-x.door[1] * reach, f.inward), scale(-x.door[1] * behind, f.along_door))
    relative = subtract(material_velocity(x, f, place), own)
    return touch(p.on_door, behind if inside else 0.0, f.inward, place, relative, x.on_door[i])


@kernel
def ground_touch(p, x, f, i):
    """Return contact of corner i with the ground."""
    place = corner(p, x, f, i)
    return touch(p.on_ground, -place[2], (0.0, 0.0, 1.0), place, material_velocity(x, f, place), x.on_ground[i])


@kernel
def wall_touch(p, x, f, i):
    """Return the contact of corner i with the crate's frictionless walls: the rear one and the two side walls."""
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
    """All contacts of the pack."""

    rollers: tuple[Touch, ...]
    door: tuple[Touch, ...]
    ground: tuple[Touch, ...]
    walls: tuple[Touch, ...]


@kernel
def contacts(p, t, x):
    """Return all contacts of the pack at time t."""
    f = frames(p, t, x)
    return Contacts(
        map_index(roller_touch, x.on_rollers, p, x, f),
        map_index(door_touch, x.on_door, p, x, f),
        map_index(ground_touch, x.on_ground, p, x, f),
        map_index(wall_touch, x.on_ground, p, x, f),
    )
