"""A multibody system: rigid bodies, revolute joints and driving constraints, checked and packed into arrays.

The reference point of every body is its centre of mass. Body index -1 is the ground, fixed in the world frame.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from lapwing.dynamics import small_matrices

GROUND = -1


@dataclass(frozen=True)
class Body:
    """A rigid body: mass [kg] and inertia about the centre of mass in body axes [kg m^2], shape (3,) or (3, 3)."""

    name: str
    mass: float
    inertia: tuple[float, ...] | np.ndarray


@dataclass(frozen=True)
class Revolute:
    """A hinge between bodies i and j (theory, eq. (8.10)): five holonomic equations.

    Points [m] and axes (any length) are in the body's own coordinates, shape (3,); for the ground: in the world frame.
    """

    name: str
    body_i: int
    body_j: int
    point_i: tuple[float, float, float]
    point_j: tuple[float, float, float]
    axis_i: tuple[float, float, float]
    axis_j: tuple[float, float, float]


@dataclass(frozen=True)
class DrivingConstraint:
    """Imposed angular velocity of body i relative to body j about an axis fixed in body j.

    Three nonholonomic equations (theory, eq. (8.15)).
    """

    name: str
    body_i: int
    body_j: int
    axis_j: tuple[float, float, float]


class Arrays(NamedTuple):
    """Arrays of n bodies, k joints and d drives for the kernels."""

    mass: np.ndarray  # (n,) [kg]
    inertia: np.ndarray  # (n, 3, 3) [kg m^2], body axes
    joint_bodies: np.ndarray  # (k, 2) indices i, j
    joint_points: np.ndarray  # (k, 2, 3) [m], body coordinates
    joint_triads: np.ndarray  # (k, 2, 3, 3) rows v1, v2, v3 = axis, body coordinates
    drive_bodies: np.ndarray  # (d, 2) indices i, j
    drive_axes: np.ndarray  # (d, 3) unit vectors, coordinates of body j
    gravity: np.ndarray  # (3,) [m/s^2], world


@dataclass(frozen=True)
class System:
    """Checked mechanism: its parts (for names) and its arrays (for kernels)."""

    bodies: tuple[Body, ...]
    joints: tuple[Revolute, ...]
    drives: tuple[DrivingConstraint, ...]
    arrays: Arrays

    def row_names(self) -> list[str]:
        """Return the name of every constraint row, holonomic ones first."""
        parts = ("point x", "point y", "point z", "axis v1", "axis v2")
        return [f"{joint.name}: {part}" for joint in self.joints for part in parts] + [
            f"{drive.name}: omega {part}" for drive in self.drives for part in "xyz"
        ]

    def without(self, name: str) -> "System":
        """Return the system without the joint or drive `name`. Raise ValueError if there is none."""
        names = [joint.name for joint in self.joints] + [drive.name for drive in self.drives]
        if name not in names:
            raise ValueError(f"no joint or drive {name!r}: choose one of {names}")
        return assemble(
            self.bodies,
            [joint for joint in self.joints if joint.name != name],
            [drive for drive in self.drives if drive.name != name],
            tuple(self.arrays.gravity),
        )


def triad(axis: ArrayLike) -> np.ndarray:
    """Return right-handed unit vectors v1, v2, v3 as rows, shape (3, 3), with v3 along `axis` (eq. (8.11))."""
    v3 = np.asarray(axis, float) / small_matrices.length(axis)
    # the coordinate axis furthest from v3 keeps the cross product far from zero
    v1 = np.cross(np.eye(3)[np.argmin(np.abs(v3))], v3)
    v1 /= small_matrices.length(v1)
    return np.array([v1, np.cross(v3, v1), v3])


def assemble(
    bodies: Iterable[Body],
    joints: Iterable[Revolute] = (),
    drives: Iterable[DrivingConstraint] = (),
    gravity: ArrayLike = (0.0, 0.0, -9.81),
) -> System:
    """Check the parts and pack them; `gravity` is in the world frame [m/s^2], shape (3,).

    Raises:
        ValueError: a mass or inertia that no rigid body has, an axis without direction, an unknown body, or a duplicate
            name.
    """
    bodies, joints, drives = tuple(bodies), tuple(joints), tuple(drives)
    for body in bodies:
        _check_body(body)
    constraints: tuple[Revolute | DrivingConstraint, ...] = (*joints, *drives)
    for constraint in constraints:
        for index in (constraint.body_i, constraint.body_j):
            if not GROUND <= index < len(bodies):
                raise ValueError(
                    f"{constraint.name}: body {index} does not exist, use 0..{len(bodies) - 1} or -1 (ground)"
                )
        if constraint.body_i == constraint.body_j:
            raise ValueError(f"{constraint.name}: connects body {constraint.body_i} with itself")
        for key in ("axis_i", "axis_j"):
            axis = getattr(constraint, key, (1.0, 0.0, 0.0))
            if not (np.all(np.isfinite(axis)) and small_matrices.length(axis) > 0.0):
                raise ValueError(f"{constraint.name}: {key} must be a direction, not {axis}")
    names = [body.name for body in bodies] + [constraint.name for constraint in constraints]
    if len(set(names)) < len(names):
        raise ValueError(f"the name {next(n for n in names if names.count(n) > 1)!r} is used twice")

    def pack(values, shape, dtype=float):
        return np.array(list(values), dtype).reshape(shape)

    arrays = Arrays(
        pack((b.mass for b in bodies), (-1,)),
        pack((_matrix(b.inertia) for b in bodies), (-1, 3, 3)),
        pack(((j.body_i, j.body_j) for j in joints), (-1, 2), np.int64),
        pack(((j.point_i, j.point_j) for j in joints), (-1, 2, 3)),
        pack(((triad(j.axis_i), triad(j.axis_j)) for j in joints), (-1, 2, 3, 3)),
        pack(((d.body_i, d.body_j) for d in drives), (-1, 2), np.int64),
        pack((np.asarray(d.axis_j, float) / small_matrices.length(d.axis_j) for d in drives), (-1, 3)),
        np.asarray(gravity, float),
    )
    return System(bodies, joints, drives, arrays)


def _matrix(inertia) -> np.ndarray:
    inertia = np.asarray(inertia, float)
    return np.diag(inertia) if inertia.ndim == 1 else inertia


def _check_body(body: Body) -> None:
    if not (np.isfinite(body.mass) and body.mass > 0.0):
        raise ValueError(f"{body.name}: mass must be positive, not {body.mass}")
    inertia = _matrix(body.inertia)
    if inertia.shape != (3, 3) or not np.all(np.isfinite(inertia)) or not np.allclose(inertia, inertia.T):
        raise ValueError(
            f"{body.name}: inertia must be three principal moments or a symmetric 3x3 matrix, not {body.inertia}"
        )
    moments = small_matrices.symmetric_eigenvalues(inertia)
    if moments[0] <= 0.0:
        raise ValueError(f"{body.name}: inertia must be positive definite, principal moments are {moments}")
    if moments[0] + moments[1] < moments[2] * (1.0 - 1e-9):
        raise ValueError(f"{body.name}: no rigid body has moments {moments}: the largest exceeds the sum of the others")
