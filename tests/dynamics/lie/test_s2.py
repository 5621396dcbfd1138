"""Directions: turning, and parallel transport around a triangle."""

import math

import pytest

from lapwing.dynamics.lie import s2, so3
from lapwing.dynamics.lie.s2 import Direction
from lapwing.dynamics.vector import apply, dot, scale

pytestmark = pytest.mark.usefixtures("uncompiled")

NORTH = Direction(0.0, 0.0, 1.0)


def test_retract_is_rotation_and_stays_unit():
    q, v = s2.normalise(Direction(0.3, -0.5, 0.9)), (1.0, 0.2, -0.4)
    assert s2.retract(q, v) == pytest.approx(apply(so3.exp(v), q), abs=1e-15)
    for _ in range(20000):
        q = s2.retract(q, (0.0123, -0.021, 0.0087))
    assert abs(dot(q, q) - 1.0) < 5e-16


def test_embed_is_derivative_along_retract():
    q, v, h = s2.normalise(Direction(0.3, -0.5, 0.9)), (1.0, 0.2, -0.4), 1e-6
    ahead, behind = s2.retract(q, scale(h, v)), s2.retract(q, scale(-h, v))
    assert [(a - b) / (2 * h) for a, b in zip(ahead, behind, strict=True)] == pytest.approx(s2.embed(q, v), abs=1e-9)


def test_transport_around_octant_turns_by_its_area():
    # north -> x -> y -> north: a triangle with three right angles, of area pi / 2
    legs = ((0.0, math.pi / 2, 0.0), (0.0, 0.0, math.pi / 2), (math.pi / 2, 0.0, 0.0))
    q, start = NORTH, (1.0, 0.0, 0.0)
    v = start
    for u in legs:
        q = s2.retract(q, u)
        v = s2.transport(scale(-1.0, u), v)  # forward: transport back along the reversed arc
    assert q == pytest.approx(NORTH, abs=1e-15)
    assert v == pytest.approx((0.0, 1.0, 0.0), abs=1e-15)
