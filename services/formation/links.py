"""The links, as the bodies at their ends show them."""

from dynamics.kernel import leaf
from dynamics.lie.ts2 import Swing, normalise
from dynamics.vector import cross, norm, scale, subtract


@leaf
def link(load, speed, positions, velocities, i):
    """Link i as its ends show it: direction from quadrotor to load, and angular velocity."""
    d = subtract(load, positions[i])
    along = 1.0 / norm(d)
    direction = scale(along, d)
    return normalise(Swing(direction, cross(direction, scale(along, subtract(speed, velocities[i])))))
