"""Contract of every integrator: measured order on each kind of space, and distance from the manifold."""

import math
from typing import NamedTuple

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from lapwing.dynamics import integrators
from lapwing.dynamics.integrators import RATES, integrate_fixed
from lapwing.dynamics.lie import quaternion, s2, so3, ts2
from lapwing.dynamics.lie.quaternion import Quaternion, rotate_back
from lapwing.dynamics.lie.s2 import Direction
from lapwing.dynamics.lie.se3 import Pose
from lapwing.dynamics.lie.so3 import Rotation
from lapwing.dynamics.lie.ts2 import Swing, tangent
from lapwing.dynamics.vector import Vec3, add, cross, divide, multiply, scale
from lapwing.dynamics.vehicles.rigid_body import RigidBody
from lapwing.kernels import always_inline, kernel
from lapwing.kernels.state_tree import embed, flatten, unflatten

pytestmark = pytest.mark.long

EPS = 2.2e-16


class EverySpace(NamedTuple):
    """One independent problem for each space, none commutative or autonomous; the product is a further test."""

    pendulum: Vec3  # R^n: angle, velocity, driven number
    quaternion: Quaternion
    matrix: Rotation
    direction: Direction
    swing: Swing
    pose: Pose


class EverySpaceParameters(NamedTuple):
    drive: float


@always_inline
def _turning(drive, t, forward_in_body):
    """Return an angular velocity that depends on time and attitude."""
    return add((drive * math.cos(t), 0.5 * math.sin(2.0 * t), 0.8 + 0.3 * t), scale(0.7, forward_in_body))


@kernel
def every_space_rate(p, t, x):
    angle, velocity, driven = x.pendulum
    q = (x.direction[0], x.direction[1], x.direction[2])
    target = (math.cos(p.drive * t), math.sin(2.0 * t), 0.4 * t)
    twist = _turning(p.drive, t, rotate_back(x.pose.attitude, (0.0, 1.0, 0.0)))
    swung = cross(x.swing.direction, add(target, scale(0.3, x.swing.omega)))
    return EverySpace(
        (velocity, -math.sin(angle) + p.drive * math.cos(1.3 * t), math.cos(2.0 * driven + angle * t)),
        _turning(p.drive, t, rotate_back(x.quaternion, (1.0, 0.0, 0.0))),
        _turning(p.drive, t, (x.matrix.m00, x.matrix.m01, x.matrix.m02)),
        add(cross(q, target), cross(q, cross(q, (0.0, 0.5, q[0])))),
        tangent(x.swing, swung),
        (add((0.3, 0.2 * t, 1.0), scale(0.1, x.pose.position)), twist),
    )


class TwistedBodyParameters(NamedTuple):
    """A rigid body under a torque of time and attitude."""

    inertia: Vec3


@always_inline
def twisted_body_rate(p, t, x):
    o = x.omega_body
    torque = cross((0.2, 0.0, 0.9), rotate_back(x.attitude, (0.3 * math.cos(t), 0.0, -1.0)))
    return RigidBody(o, divide(add(torque, cross(multiply(p.inertia, o), o)), p.inertia))


RATES.update({EverySpaceParameters: every_space_rate, TwistedBodyParameters: twisted_body_rate})

SPACES = (
    EverySpaceParameters(1.1),
    EverySpace(
        (1.0, 0.2, 0.0),
        quaternion.exp((0.3, -0.5, 0.2)),
        so3.exp((0.3, -0.5, 0.2)),
        s2.normalise(Direction(0.3, -0.5, 0.9)),
        ts2.normalise(Swing((0.3, -0.5, 0.9), (1.0, 0.4, 0.2))),
        Pose((0.2, -0.1, 0.4), quaternion.exp((-0.4, 0.1, 0.6))),
    ),
)
BODY = (TwistedBodyParameters((1.0, 1.6, 2.1)), RigidBody(quaternion.exp((0.3, -0.5, 0.2)), (0.6, -0.9, 1.2)))
SPAN = 1.6
COUNTS = {1: (512, 1024, 2048), 2: (64, 128, 256), 3: (32, 64, 128), 4: (20, 40, 80), 5: (24, 40, 64), 6: (4, 6, 9)}
COUNTS[8] = (7, 10, 13)


def reference(p, x0):
    """Return the solution of SciPy's DOP853 in the embedding, with a tolerance of 1e-13."""
    rate = RATES[type(p)].py_func

    def right_hand_side(t, y):
        x = unflatten(x0, tuple(y))
        return flatten(embed(x, rate(p, t, x)))

    end = solve_ivp(right_hand_side, (0.0, SPAN), flatten(x0), method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    return unflatten(x0, tuple(map(float, end)))


@pytest.fixture(scope="module")
def exact():
    return {type(x0): reference(p, x0) for p, x0 in (SPACES, BODY)}


def problem(method):
    return BODY if hasattr(method, "incompatibility") else SPACES


def defect(x):
    """Return the largest error of the invariants of all manifold leaves."""
    if isinstance(x, Quaternion | Direction):
        return abs(sum(c * c for c in x) - 1.0)
    if isinstance(x, Rotation):
        m = np.array(x).reshape(3, 3)
        return abs(m.T @ m - np.eye(3)).max()
    if isinstance(x, Swing):
        q, omega = map(np.array, x)
        return max(abs(q @ q - 1.0), abs(q @ omega) / (1.0 + abs(omega).max()))
    return max(map(defect, x)) if isinstance(x, tuple) else 0.0


def distance(x, y):
    return np.linalg.norm(np.array(flatten(x)) - np.array(flatten(y)))


@pytest.mark.parametrize("name", integrators.names())
def test_order_and_manifold(name, exact):
    method = integrators.get(name)
    p, x0 = problem(method)
    steps = [SPAN / n for n in COUNTS[method.ORDER]]
    ends = [integrate_fixed(method.Method(), p, 0.0, x0, SPAN / n, n) for n in COUNTS[method.ORDER]]
    if method.ON_MANIFOLD:
        assert max(map(defect, ends)) < 8 * EPS
    measured = {}
    for i, space in enumerate(x0._fields):
        errors = [distance(x[i : i + 1], exact[type(x0)][i : i + 1]) for x in ends]
        assert min(errors) > 1e-13, f"{space}: errors {errors} too close to round-off to fit"
        measured[space] = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    for space, order in measured.items():
        declared = getattr(method, "FLAT_ORDER", method.ORDER) if space == "pendulum" else method.ORDER
        assert declared - 0.2 < order < declared + 0.7, f"{space}: measured {measured}"


class CountingNumberParameters(NamedTuple):
    """x' = x with a count of evaluations."""

    count: np.ndarray


@kernel
def counting_number_rate(p, t, x):
    p.count[0] += 1
    return x


class CountingBodyParameters(NamedTuple):
    """Twisted body with a count of evaluations."""

    inertia: Vec3
    count: np.ndarray


@kernel
def counting_body_rate(p, t, x):
    p.count[0] += 1
    return twisted_body_rate(p, t, x)


RATES.update({CountingNumberParameters: counting_number_rate, CountingBodyParameters: counting_body_rate})


@pytest.mark.parametrize("name", [n for n in integrators.names() if hasattr(integrators.get(n), "EVALUATIONS")])
def test_evaluations_equal_declared_count(name, uncompiled):
    method, (body, start), count = integrators.get(name), BODY, np.zeros(1, dtype=np.int64)
    on_body = hasattr(method, "incompatibility")
    p = CountingBodyParameters(body.inertia, count) if on_body else CountingNumberParameters(count)
    integrate_fixed(method.Method(), p, 0.0, start if on_body else (0.3,), 0.1, 1)
    assert count[0] == method.EVALUATIONS


def test_unknown_name_lists_choices():
    with pytest.raises(ValueError, match=r"unknown integrator 'rk5'; did you mean .* \(integrators: .*rk4.*rkmk4"):
        integrators.get("rk5")


def test_drifting_method_declares_its_drift():
    p, x0 = SPACES
    drifting = [n for n in integrators.names() if not integrators.get(n).ON_MANIFOLD]
    assert drifting
    for name in drifting:
        assert defect(integrate_fixed(integrators.get(name).Method(), p, 0.0, x0, 0.1, 16)) > 1e-7
