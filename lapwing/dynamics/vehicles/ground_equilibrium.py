"""Equilibrium of a vehicle on the ground: supporting feet, and rest on their springs."""

import itertools
from collections.abc import Sequence
from types import ModuleType
from typing import Any

import numpy as np

from lapwing.dynamics import small_matrices
from lapwing.dynamics.effects._contact_parameters import GroundContact, GroundContactSmooth
from lapwing.dynamics.lie import quaternion
from lapwing.dynamics.lie.quaternion import NO_ROTATION, Quaternion
from lapwing.dynamics.terrain import LEVEL, Level, Relief, surface
from lapwing.dynamics.vector import ZERO, Mat3, Vec3
from lapwing.dynamics.vector import apply as compiled_apply
from lapwing.dynamics.vehicles.multirotor_equations import MultirotorParameters, MultirotorState
from lapwing.kernels import math, python_function

ITERATIONS = 50  # number of iterations: the feet move sideways as the vehicle tilts; on a plane three are enough
CONVERGED = 1e-12  # change of the slope between two iterations at convergence
BALANCED, TOLERATED = 1e-12, 1e-8  # residual force over the weight: desired, and required
NUDGE = 1e-8  # [m] step of numerical derivatives of the forces
NO_SLOPE = (0.0, 0.0)

Pose = tuple[Vec3, Quaternion]  # position of the centre of mass [m] in the world, attitude
Place = tuple[float, float]  # world x and y [m]

# thousands of calls, each faster than passing its arguments to compiled code
apply = python_function(compiled_apply)
from_matrix, rotation_matrix = python_function(quaternion.from_matrix), python_function(quaternion.rotation_matrix)


def resting_pose(feet: Sequence[Vec3], terrain: Level | Relief = LEVEL, place: Place = (0.0, 0.0)) -> Pose:
    """Return the pose of a vehicle on the ground, with its centre of mass at a place and heading along world x.

    Three feet around its centre of mass touch without load and no other is below the ground; equal feet on a plane all
    touch. Without three such feet it is not tilted, and will fall over.

    Args:
        feet: possible contact points [m], body coordinates.
        terrain: terrain.
        place: world x and y of the centre of mass [m]; the origin is home.
    """
    x0, y0 = place
    if not feet:
        return (x0, y0, 0.0), NO_ROTATION
    slope = NO_SLOPE
    for _ in range(ITERATIONS):
        R_world_body = _attitude_on_plane(slope)
        arms = [apply(R_world_body, foot) for foot in feet]
        lifts = [surface(terrain, x0 + x, y0 + y)[0] - z for x, y, z in arms]  # [m] height at which that foot touches
        change = _support_plane([(x, y, lift) for (x, y, _), lift in zip(arms, lifts, strict=True)]) or NO_SLOPE
        if math.hypot(*change) < CONVERGED:
            break
        slope = (slope[0] + change[0], slope[1] + change[1])
    return (x0, y0, max(lifts)), NO_ROTATION if slope == NO_SLOPE else from_matrix(R_world_body)


def static_equilibrium(formulation: ModuleType, p: MultirotorParameters, pose: Pose, gravity: float) -> MultirotorState:
    """Return the state of a vehicle at rest on the springs and friction of its feet.

    If the ground is too steep for the friction, or the feet do not surround the centre of mass, the vehicle starts to
    slide or fall from this state.

    Args:
        formulation: module of the formulation: `lapwing.dynamics.vehicles.multirotor` or one with more bodies.
        p: parameters of the vehicle.
        pose: pose from `resting_pose`.
        gravity: [m/s^2].
    """
    position, attitude = pose
    k = next((k for k, e in enumerate(p.effects) if isinstance(e, GroundContact | GroundContactSmooth)), None)
    if k is None or gravity <= 0.0:
        return formulation.initial_state(p, position, attitude)
    position, attitude = _balance(p.effects[k], p.body.mass * gravity, position, attitude)
    state = formulation.initial_state(p, position, attitude)
    deflections = _deflections(p.effects[k], position, attitude)
    return state._replace(memory=(*state.memory[:k], deflections or state.memory[k], *state.memory[k + 1 :]))


def _balance(e: Any, weight: float, position: Vec3, attitude: Quaternion) -> Pose:
    """Return the nearby pose in which springs and weight [N] balance, by Newton's method; `pose` if there is none."""
    R = rotation_matrix(attitude)
    x = np.array([position[2], R[6] / R[0], R[7] / R[4] - R[6] * R[1] / (R[0] * R[4])])  # height, slopes of the body
    x[0] -= 1.0 / e.inverse_width + weight / (len(e.feet) * e.stiffness)  # every spring loaded
    place = position[:2]
    residual = _springs(e, weight, x, place)
    left = _norm(residual)
    for _ in range(ITERATIONS):
        if left < BALANCED * weight:
            break
        growth = np.array([_springs(e, weight, x + change, place) - residual for change in NUDGE * np.eye(3)]).T / NUDGE
        try:
            step = small_matrices.solve(growth, -residual[:, None])[:, 0]
        except small_matrices.SingularMatrixError:  # fewer than three feet are loaded
            return position, attitude
        shares = [math.ldexp(1.0, -k) for k in range(20)]
        for trial in (x + share * step for share in shares):
            result = _springs(e, weight, trial, place)
            if (nearer := _norm(result)) < left:
                break
        else:
            break  # limited by round-off
        x, residual, left = trial, result, nearer
    if not left < TOLERATED * weight:
        return position, attitude
    slope = (float(x[1]), float(x[2]))
    level = NO_ROTATION if attitude == NO_ROTATION and math.hypot(*slope) < CONVERGED else None
    return (*place, float(x[0])), level or from_matrix(_attitude_on_plane(slope))


def _springs(e: Any, weight: float, x: np.ndarray, place: Place) -> np.ndarray:
    """Return the vertical force [N] of the feet minus the weight, and its moments about the centre of mass [N m].

    `x`: height [m] and slopes of the vehicle. A foot held by friction pushes vertically.
    """
    height, *slope = x.tolist()
    R_world_body = _attitude_on_plane(slope)
    force, x_moment, y_moment = -weight, 0.0, 0.0  # scalars: arrays of three numbers are slower
    for foot in e.feet:
        arm = apply(R_world_body, foot)
        depth, normal = _depth(e, arm, (*place, height))
        if depth > 0.0:
            push = _press(e, depth) / normal[2]
            force, x_moment, y_moment = force + push, x_moment + push * arm[0], y_moment + push * arm[1]
    return np.array([force, x_moment, y_moment])


def _norm(residual: np.ndarray) -> float:
    return math.sqrt(residual.dot(residual))


def _depth(e: Any, arm: Vec3, centre: Vec3) -> tuple[float, Vec3]:
    """Return (depth of a foot in the ground [m], the ground's normal), as in `effects._foot_contact`."""
    ground, normal = surface(e.terrain, centre[0] + arm[0], centre[1] + arm[1])
    return (ground - (centre[2] + arm[2])) * normal[2], normal


def _press(e: Any, depth: float) -> float:
    """Return the normal force [N] of a foot at rest."""
    onset = min(depth * e.inverse_width, 1.0)
    return onset * onset * (3.0 - 2.0 * onset) * e.stiffness * depth


def _deflections(e: Any, position: Vec3, attitude: Quaternion) -> tuple[Vec3, ...] | None:
    """Return the deflections [m] of feet held by friction. Return None if it is too weak or has no state."""
    if not isinstance(e, GroundContact):
        return None
    result = []
    for foot in e.feet:
        arm = apply(rotation_matrix(attitude), foot)
        depth, (nx, ny, nz) = _depth(e, arm, position)
        if depth <= 0.0:
            result.append(ZERO)
            continue
        if math.hypot(nx, ny) > e.static * nz:
            return None
        # a vertical force has the normal part `press` and the tangential part press (z / n_z - n)
        pull = _press(e, depth) / e.tangential_stiffness
        result.append((pull * nx, pull * ny, pull * (nz - 1.0 / nz)))
    return tuple(result)


def _attitude_on_plane(slope: Sequence[float]) -> Mat3:
    """Return R_world_body of a body on a plane z = a x + b y, with its x axis above the world's."""
    a, b = slope
    forward, normal = 1.0 / math.hypot(1.0, a), 1.0 / math.sqrt(1.0 + a * a + b * b)
    x = (forward, 0.0, a * forward)
    z = (-a * normal, -b * normal, normal)
    y = (z[1] * x[2] - z[2] * x[1], z[2] * x[0] - z[0] * x[2], z[0] * x[1] - z[1] * x[0])
    return (x[0], y[0], z[0], x[1], y[1], z[1], x[2], y[2], z[2])


def _support_plane(points: Sequence[Vec3]) -> tuple[float, float] | None:
    """Return the slope of the highest plane over the origin through three points around it, or None."""
    best: tuple[float, tuple[float, float]] | None = None
    for p, q, r in itertools.combinations(points, 3):
        twice_area = (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
        if twice_area == 0.0:
            continue
        shares = [(s[0] * t[1] - s[1] * t[0]) / twice_area for s, t in ((q, r), (r, p), (p, q))]
        height = math.total(share * point[2] for share, point in zip(shares, (p, q, r), strict=True))
        if min(shares) < -1e-9 or (best is not None and height <= best[0]):
            continue
        dq, dr = q[2] - p[2], r[2] - p[2]
        a = (dq * (r[1] - p[1]) - dr * (q[1] - p[1])) / twice_area
        b = (dr * (q[0] - p[0]) - dq * (r[0] - p[0])) / twice_area
        best = height, (a, b)
    return best and best[1]
