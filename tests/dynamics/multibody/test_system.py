"""Impossible descriptions of mechanisms are rejected in one line."""

import numpy as np
import pytest

from lapwing.dynamics.multibody.system import GROUND, Body, DrivingConstraint, Revolute, assemble, triad

BAR = Body("bar", 1.0, (0.1, 0.2, 0.2))
HINGE = Revolute("hinge", GROUND, 0, (0.0, 0.0, 0.0), (-0.5, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 1.0))


@pytest.mark.parametrize("axis", [(0, 0, 1), (0, 0, -2), (1, 2, 3), (1e-9, 1, 0)])
def test_triad_is_right_handed_and_ends_on_axis(axis):
    V = triad(axis)
    np.testing.assert_allclose(V @ V.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(V) == pytest.approx(1.0)
    np.testing.assert_allclose(V[2], np.array(axis) / np.linalg.norm(axis), atol=1e-15)


@pytest.mark.parametrize(
    ("bodies", "joints", "drives", "message"),
    [
        ([Body("bar", -1.0, (1, 1, 1))], [], [], "bar: mass must be positive"),
        ([Body("bar", float("nan"), (1, 1, 1))], [], [], "bar: mass must be positive"),
        ([Body("bar", 1.0, (1, 1, 0))], [], [], "bar: inertia must be positive definite"),
        ([Body("bar", 1.0, (1, 1, 3))], [], [], "bar: no rigid body has moments"),
        ([Body("bar", 1.0, (1, 1))], [], [], "bar: inertia must be three principal moments"),
        ([BAR, BAR], [], [], "'bar' is used twice"),
        (
            [BAR],
            [Revolute("hinge", 0, 1, (0, 0, 0), (0, 0, 0), (0, 0, 1), (0, 0, 1))],
            [],
            "hinge: body 1 does not exist",
        ),
        ([BAR], [Revolute("hinge", 0, 0, (0, 0, 0), (0, 0, 0), (0, 0, 1), (0, 0, 1))], [], "with itself"),
        (
            [BAR],
            [Revolute("hinge", -1, 0, (0, 0, 0), (0, 0, 0), (0, 0, 0), (0, 0, 1))],
            [],
            "hinge: axis_i must be a direction",
        ),
        ([BAR], [], [DrivingConstraint("motor", 0, -1, (0, 0, 0))], "motor: axis_j must be a direction"),
    ],
)
def test_impossible_parts_are_rejected(bodies, joints, drives, message):
    with pytest.raises(ValueError, match=message):
        assemble(bodies, joints, drives)


def test_removed_constraint_has_no_rows():
    system = assemble([BAR], [HINGE], [DrivingConstraint("motor", 0, GROUND, (0, 0, 1))])
    assert len(system.row_names()) == 8
    assert system.without("hinge").row_names() == ["motor: omega x", "motor: omega y", "motor: omega z"]
    with pytest.raises(ValueError, match="no joint or drive 'belt'"):
        system.without("belt")
