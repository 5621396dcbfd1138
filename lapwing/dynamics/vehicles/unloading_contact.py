"""Contact law of the pack: one-sided, damped, with static friction.

The normal force is that of a spring and a damper that never pull; friction is the model of Canudas de Wit, Olsson,
Astrom and Lischinsky (IEEE Trans. Autom. Control 40 (1995) 419), whose bristles carry a load at rest without creep
(theory, eqs. (9.4) to (9.6)).
"""

from typing import NamedTuple

from lapwing.dynamics.vector import Vec3, add, dot, norm, scale, subtract
from lapwing.kernels import always_inline, math

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
