"""How a vehicle stands on the ground: on which feet, and at rest on their springs before anything moves."""

import itertools
from collections.abc import Sequence
from types import ModuleType
from typing import Any

import numpy as np

from lapwing.dynamics import small_matrices
from lapwing.dynamics.effects._contact_parameters import NOWHERE, STICKING, GroundContact, GroundContactSmooth
from lapwing.dynamics.lie import quaternion
from lapwing.dynamics.lie.quaternion import NO_ROTATION, Quaternion
from lapwing.dynamics.terrain import LEVEL, Level, Relief, surface
from lapwing.dynamics.vector import Mat3, Vec3
from lapwing.dynamics.vector import apply as compiled_apply
from lapwing.dynamics.vehicles.multirotor_equations import MultirotorParameters, MultirotorState
from lapwing.kernels import math, python_function

ITERATIONS = 50  # the feet move sideways as the vehicle tilts; on a plane three are enough
CONVERGED = 1e-12  # change of the slope between two iterations
BALANCED, TOLERATED = 1e-12, 1e-8  # force that is not balanced, over the weight: sought, and found at least
NUDGE = 1e-8  # [m] for slopes of the forces
NO_SLOPE = (0.0, 0.0)

Pose = tuple[Vec3, Quaternion]  # position of the centre of mass [m] in the world, attitude
Place = tuple[float, float]  # world x and y [m]

# thousands of calls, each cheaper than handing its arguments to machine code
apply = python_function(compiled_apply)
from_matrix, rotation_matrix = python_function(quaternion.from_matrix), python_function(quaternion.rotation_matrix)


def resting_pose(feet: Sequence[Vec3], terrain: Level | Relief = LEVEL, place: Place = (0.0, 0.0)) -> Pose:
    """Where a vehicle stands whose centre of mass is over a place, heading along world x.

    It is tilted so that three feet around its centre of mass touch without pressing and no other is below the ground;
    equal feet on a plane all touch. Where there are no such three, it is not tilted, and will fall over.

    Args:
        feet: points that may touch [m], body coordinates.
        terrain: the ground.
        place: world x and y of the centre of mass [m]; the origin is home.
    """
    x0, y0 = place
    if not feet:
        return (x0, y0, 0.0), NO_ROTATION
    slope = NO_SLOPE
    for _ in range(ITERATIONS):
        R_world_body = _aligned(slope)
        arms = [apply(R_world_body, foot) for foot in feet]
        lifts = [surface(terrain, x0 + x, y0 + y)[0] - z for x, y, z in arms]  # [m] at which that foot touches
        change = _carrying([(x, y, lift) for (x, y, _), lift in zip(arms, lifts, strict=True)]) or NO_SLOPE
        if math.hypot(*change) < CONVERGED:
            break
        slope = (slope[0] + change[0], slope[1] + change[1])
    return (x0, y0, max(lifts)), NO_ROTATION if slope == NO_SLOPE else from_matrix(R_world_body)


def static_equilibrium(form: ModuleType, p: MultirotorParameters, pose: Pose, gravity: float) -> MultirotorState:
    """The state of a vehicle that stands still: the springs of its feet carry it, and their friction holds it.

    Where the ground is too steep for the friction, or the feet do not stand around the centre of mass, it is the state
    in which the vehicle begins to slide or to fall.

    Args:
        form: module that makes the state: `lapwing.dynamics.vehicles.multirotor` or one with more bodies.
        p: the vehicle.
        pose: where it stands, from `resting_pose`.
        gravity: [m/s^2].
    """
    position, attitude = pose
    k = next((k for k, e in enumerate(p.effects) if isinstance(e, GroundContact | GroundContactSmooth)), None)
    if k is None or gravity <= 0.0:
        return form.initial_state(p, position, attitude)
    position, attitude = _balanced(p.effects[k], p.body.mass * gravity, position, attitude)
    state = form.initial_state(p, position, attitude)
    anchors = _anchors(p.effects[k], position, attitude)
    return state._replace(memory=(*state.memory[:k], anchors or state.memory[k], *state.memory[k + 1 :]))


def _balanced(e: Any, weight: float, position: Vec3, attitude: Quaternion) -> Pose:
    """Where springs and weight [N] balance, near a pose: Newton's method on height and slopes; that pose if nowhere."""
    R = rotation_matrix(attitude)
    x = np.array([position[2], R[6] / R[0], R[7] / R[4] - R[6] * R[1] / (R[0] * R[4])])  # height, slopes of the body
    x[0] -= 1.0 / e.inverse_width + weight / (len(e.feet) * e.stiffness)  # every spring beyond its onset
    place = position[:2]
    residual = _springs(e, weight, x, place)
    left = _norm(residual)
    for _ in range(ITERATIONS):
        if left < BALANCED * weight:
            break
        growth = np.array([_springs(e, weight, x + change, place) - residual for change in NUDGE * np.eye(3)]).T / NUDGE
        try:
            step = small_matrices.solve(growth, -residual[:, None])[:, 0]
        except small_matrices.SingularMatrixError:  # fewer than three feet press
            return position, attitude
        shares = [math.ldexp(1.0, -k) for k in range(20)]
        for trial in (x + share * step for share in shares):
            found = _springs(e, weight, trial, place)
            if (nearer := _norm(found)) < left:
                break
        else:
            break  # as near as numbers allow
        x, residual, left = trial, found, nearer
    if not left < TOLERATED * weight:
        return position, attitude
    slope = (float(x[1]), float(x[2]))
    level = NO_ROTATION if attitude == NO_ROTATION and math.hypot(*slope) < CONVERGED else None
    return (*place, float(x[0])), level or from_matrix(_aligned(slope))


def _springs(e: Any, weight: float, x: np.ndarray, place: Place) -> np.ndarray:
    """Vertical force [N] of the feet less the weight, and its moments about the centre of mass [N m].

    `x`: height [m] and slopes of the vehicle. A foot that friction holds pushes straight up.
    """
    height, *slope = x.tolist()
    R_world_body = _aligned(slope)
    force, x_moment, y_moment = -weight, 0.0, 0.0  # one by one: arrays of three numbers take longer
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
    """(how deep a foot is in the ground [m], the ground's normal), as in `lapwing.dynamics.effects._foot_contact`."""
    ground, normal = surface(e.terrain, centre[0] + arm[0], centre[1] + arm[1])
    return (ground - (centre[2] + arm[2])) * normal[2], normal


def _press(e: Any, depth: float) -> float:
    """Normal force [N] of a foot at rest."""
    onset = min(depth * e.inverse_width, 1.0)
    return onset * onset * (3.0 - 2.0 * onset) * e.stiffness * depth


def _anchors(e: Any, position: Vec3, attitude: Quaternion) -> tuple[Any, ...] | None:
    """The memory of feet whose friction holds them; None where it is too weak, or remembers nothing."""
    if not isinstance(e, GroundContact):
        return None
    found = []
    for foot in e.feet:
        arm = apply(rotation_matrix(attitude), foot)
        depth, (nx, ny, nz) = _depth(e, arm, position)
        if depth <= 0.0:
            found.append(NOWHERE)
            continue
        if math.hypot(nx, ny) > e.static * nz:
            return None
        # straight up is: press along the normal, and across it what has -n_x press, -n_y press along x and y
        pull = _press(e, depth) / e.tangential_stiffness
        found.append((position[0] + arm[0] - pull * nx, position[1] + arm[1] - pull * ny, 0.0, STICKING, 0.0))
    return tuple(found)


def _aligned(slope: Sequence[float]) -> Mat3:
    """R_world_body of a body that stands on a plane z = a x + b y, with its x axis over the world's."""
    a, b = slope
    forward, normal = 1.0 / math.hypot(1.0, a), 1.0 / math.sqrt(1.0 + a * a + b * b)
    x = (forward, 0.0, a * forward)
    z = (-a * normal, -b * normal, normal)
    y = (z[1] * x[2] - z[2] * x[1], z[2] * x[0] - z[0] * x[2], z[0] * x[1] - z[1] * x[0])
    return (x[0], y[0], z[0], x[1], y[1], z[1], x[2], y[2], z[2])


def _carrying(points: Sequence[Vec3]) -> tuple[float, float] | None:
    """Slope of the highest plane over the origin through three of the points around it; None if there are none."""
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
