"""The links, as the bodies at their ends show them."""

from lapwing.dynamics.lie.ts2 import Swing, normalise
from lapwing.dynamics.vector import Vec3, cross, norm, scale, subtract
from lapwing.kernels import always_inline


@always_inline
def link(load: Vec3, speed: Vec3, positions: tuple[Vec3, ...], velocities: tuple[Vec3, ...], i: int) -> Swing:
    """Link i as its ends show it: direction from quadrotor to load, and angular velocity."""
    d = subtract(load, positions[i])
    along = 1.0 / norm(d)
    direction = scale(along, d)
    return normalise(Swing(direction, cross(direction, scale(along, subtract(speed, velocities[i])))))
