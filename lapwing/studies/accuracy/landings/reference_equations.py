"""Equations of motion of the reference of a landing, by cases that hold between its events.

Independent of `lapwing.dynamics`: attitudes are matrices. The cases of a foot are those of touchdown and lift-off,
full onset of the normal force, change of its sign, sticking and sliding, the slip at which the dynamic coefficient is
reached (theory, section 2.8), and on ground with a step the nearest face: its top, its wall, the ground before it,
or wall and ground at once in the inner corner (section 2.9).
"""

import math
from typing import Any, NamedTuple

import numpy as np

from lapwing.kernels import kernel

FULL, SLOW = 1, 4  # other rows of the cases: 0 in the ground, 2 pressing, 3 sliding
BEYOND, TOP, FLOOR = 5, 6, 7  # of a step: behind its wall, nearer to its top than to its wall, below the ground


class LandingBody(NamedTuple):
    """Rigid body with contact points, and rotors with decaying speeds."""

    mass: float  # [kg]
    inertia: np.ndarray  # [kg m^2] principal, shape (3,)
    points: np.ndarray  # [m] in the body, shape (n, 3)
    rotors: np.ndarray  # [m] in the body, shape (m, 3)
    signs: np.ndarray  # of the torque on the body, shape (m,)
    thrust: float  # [N s^2] over the squared rotor speed
    torque: float  # [N m s^2] over the squared rotor speed
    lag: float  # [1/s] decay rate of the rotors
    gravity: float  # [m/s^2]


class LandingGround(NamedTuple):
    """Ground z = a x + b y + A sin k x sin k y, on it a step up along x or a rounded fold; the law of contact."""

    slope: tuple[float, float]
    bump: float  # [m] A
    wave: float  # [1/m] k
    stiffness: float  # [N/m]
    damping: float  # [N s/m]
    width: float  # [m]
    static: float
    dynamic: float
    shear_stiffness: float  # [N/m]
    shear_damping: float  # [N s/m]
    slow: float  # [m/s] slip of the dynamic coefficient
    edge: float = math.inf  # [m] x of the step's wall
    rise: float = 0.0  # [m] z of its level top
    flank: float = 0.0  # slope of the ground on both sides of a fold at x = 0
    rounding: float = 1.0  # [m] x to which the fold is rounded


@kernel
def _foot(body: Any, ground: Any, cases: np.ndarray, y: np.ndarray, i: int) -> Any:
    """Return (arm, normal, depth [m], approach [m/s], slip [m/s], shear, shear [N], wedge factor) of a point, world."""
    arm, rotation_velocity = np.zeros(3), np.zeros(3)
    b = body.points[i]
    o = y[15:18]
    rotation = (o[1] * b[2] - o[2] * b[1], o[2] * b[0] - o[0] * b[2], o[0] * b[1] - o[1] * b[0])
    for row in range(3):
        for k in range(3):
            arm[row] += y[3 + 3 * row + k] * b[k]
            rotation_velocity[row] += y[3 + 3 * row + k] * rotation[k]
    u, v = ground.wave * (y[0] + arm[0]), ground.wave * (y[1] + arm[1])
    height = ground.slope[0] * (y[0] + arm[0]) + ground.slope[1] * (y[1] + arm[1])
    height += ground.bump * math.sin(u) * math.sin(v)
    gradient, fold = ground.bump * ground.wave, (y[0] + arm[0]) / ground.rounding
    flank = ground.flank if fold >= 0.0 else -ground.flank
    if abs(fold) < 1.0:  # between samples |x|: cubic with the slopes 0 and 1 at its ends
        flank *= abs(fold) * (4.0 - 3.0 * abs(fold))
        height += ground.flank * ground.rounding * fold * fold * (2.0 - abs(fold))
    else:
        height += ground.flank * abs(y[0] + arm[0])
    normal = np.array(
        [
            -ground.slope[0] - flank - gradient * math.cos(u) * math.sin(v),
            -ground.slope[1] - gradient * math.sin(u) * math.cos(v),
            1.0,
        ]
    )
    normal /= math.sqrt((normal * normal).sum())
    depth, wedge = (height - y[2] - arm[2]) * normal[2], 1.0
    if cases[BEYOND, i] and cases[TOP, i]:
        normal, depth = np.array([0.0, 0.0, 1.0]), ground.rise - y[2] - arm[2]
    elif cases[BEYOND, i] and not cases[FLOOR, i]:
        normal, depth = np.array([-1.0, 0.0, 0.0]), y[0] + arm[0] - ground.edge
    elif cases[BEYOND, i]:
        behind, below = y[0] + arm[0] - ground.edge, -y[2] - arm[2]
        depth = math.sqrt(behind * behind + below * below)
        normal, wedge = np.array([-behind / depth, 0.0, below / depth]), (behind + below) / depth
    velocity = y[12:15] + rotation_velocity
    rising = (velocity * normal).sum()
    slip = velocity - rising * normal
    deflection = y[len(y) - 3 * (len(body.points) - i) :][:3]
    along = (deflection * normal).sum()
    shear = ground.shear_stiffness * (deflection - along * normal) + ground.shear_damping * slip
    size, speed = math.sqrt((shear * shear).sum()), math.sqrt((slip * slip).sum())
    return arm, normal, depth, -rising, speed, shear, size, wedge


@kernel
def _limit(ground: Any, cases: np.ndarray, i: int, depth: float, approach: float, speed: float, wedge: float) -> Any:
    """Return (normal force, friction at which the point slides) [N] under given cases."""
    if not (cases[0, i] and cases[2, i]):
        return 0.0, 0.0
    xi, slow = depth / ground.width, speed / ground.slow
    onset = 1.0 if cases[FULL, i] else xi * xi * (3.0 - 2.0 * xi)
    normal_force = onset * (ground.stiffness * depth + ground.damping * approach)
    decay = slow * slow * (3.0 - 2.0 * slow) if cases[SLOW, i] else 1.0
    return normal_force, (ground.static + (ground.dynamic - ground.static) * decay) * wedge * normal_force


@kernel
def rate(body: Any, ground: Any, cases: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the derivative of (position, R_world_body, velocity, omega_body, rotor speeds, deflections)."""
    n, m = len(body.points), len(body.rotors)
    result = np.zeros_like(y)
    R, o = y[3:12].copy().reshape(3, 3), y[15:18]
    force, torque_world = np.array([0.0, 0.0, -body.mass * body.gravity]), np.zeros(3)
    torque = np.zeros(3)
    for k in range(m):
        square = y[18 + k] * y[18 + k]
        force += body.thrust * square * R[:, 2]
        torque[0] += body.rotors[k, 1] * body.thrust * square
        torque[1] -= body.rotors[k, 0] * body.thrust * square
        torque[2] += body.signs[k] * body.torque * square
        result[18 + k] = -body.lag * y[18 + k]
    for i in range(n):
        at = 18 + m + 3 * i
        stretch = -ground.shear_stiffness / ground.shear_damping * y[at : at + 3]
        if cases[0, i] and cases[2, i]:
            arm, normal, depth, approach, speed, shear, size, wedge = _foot(body, ground, cases, y, i)
            normal_force, limit = _limit(ground, cases, i, depth, approach, speed, wedge)
            current = shear * (limit / max(size, 1e-300)) if cases[3, i] else shear
            stretch = stretch + current / ground.shear_damping
            push = normal_force * normal - current
            force += push
            torque_world += np.array(
                [
                    arm[1] * push[2] - arm[2] * push[1],
                    arm[2] * push[0] - arm[0] * push[2],
                    arm[0] * push[1] - arm[1] * push[0],
                ]
            )
        result[at : at + 3] = stretch
    for k in range(3):
        torque[k] += (R[:, k] * torque_world).sum()
    h = body.inertia * o
    result[:3] = y[12:15]
    for row in range(3):
        result[3 + 3 * row] = R[row, 1] * o[2] - R[row, 2] * o[1]
        result[4 + 3 * row] = R[row, 2] * o[0] - R[row, 0] * o[2]
        result[5 + 3 * row] = R[row, 0] * o[1] - R[row, 1] * o[0]
    result[12:15] = force / body.mass
    result[15] = (torque[0] - o[1] * h[2] + o[2] * h[1]) / body.inertia[0]
    result[16] = (torque[1] - o[2] * h[0] + o[0] * h[2]) / body.inertia[1]
    result[17] = (torque[2] - o[0] * h[1] + o[1] * h[0]) / body.inertia[2]
    return result


@kernel
def margins(body: Any, ground: Any, cases: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return functions that are positive if a case holds, shape (8, n); their signs change at events."""
    result = np.empty((8, len(body.points)))
    for i in range(len(body.points)):
        arm, _, depth, approach, speed, _, size, wedge = _foot(body, ground, cases, y, i)
        result[0, i], result[1, i] = depth, depth - ground.width
        result[2, i] = ground.stiffness * depth + ground.damping * approach
        result[3, i] = size - _limit(ground, cases, i, depth, approach, speed, wedge)[1]
        result[4, i] = ground.slow - speed
        behind, above = y[0] + arm[0] - ground.edge, y[2] + arm[2]
        outward = math.sqrt(behind * behind + above * above) if cases[FLOOR, i] else behind
        result[BEYOND, i], result[TOP, i], result[FLOOR, i] = behind, outward + above - ground.rise, -above
    return result


def cases_at(body: LandingBody, ground: LandingGround, y: np.ndarray) -> np.ndarray:
    """Return the cases of a state."""
    cases = np.zeros((8, len(body.points)), dtype=bool)
    for _ in range(3):  # the depth depends on the face, the friction limit on other cases
        cases = margins(body, ground, cases, y) > 0.0
    return cases
