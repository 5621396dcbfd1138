"""Case 9, toppling: a vehicle released tilted, or pushed, over the edge of its feet."""

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from lapwing.dynamics.lie.quaternion import exp, rotation_matrix
from lapwing.dynamics.vector import scale
from lapwing.studies.stability.case_result import CaseResult, Curve, Plot, Row, Sweep
from lapwing.studies.stability.cases.landing import (
    DAMPING,
    DRONE,
    HEIGHT,
    STEP,
    STIFFNESS,
    G,
    run_on,
    state_above_slope,
)
from lapwing.studies.stability.cases.slopes import energy

HARD = "a vehicle tilted or pushed over the edge of its feet: a billionth of a radian decides between fall and return"

MASS, FEET = DRONE.mass.total, DRONE.contact.feet if DRONE.contact else ()
AXES = (0, 1)  # roll, pitch
SECONDS = 5.0  # a deviation of 1e-9 rad grows to 0.1 rad, by 4.5 or 4.7 e-folds per second
FRICTION, GRIP = 0.5, 2.0  # coefficients: of the effect; for a push without slip
NEAR = 1e-4  # [rad] from the edge
LEAN_BOUND, PUSH_BOUND, ENERGY_BOUND = 1e-9, 1e-3, 1e-9


def base(axis: int) -> float:
    """Return half the distance [m] between the feet across the tilt axis."""
    return float(max(foot[1 - axis] for foot in FEET))


def edge(axis: int) -> float:
    """Return the tilt [rad] at which the centre of mass is above the feet.

    The ground force then passes through it at any penetration, so the springs do not move the edge.
    """
    return math.atan(base(axis) / HEIGHT)


def unit(axis: int) -> tuple[float, float, float]:
    """Return the unit vector of the body axis x (0) or y (1)."""
    return (1.0, 0.0, 0.0) if axis == 0 else (0.0, 1.0, 0.0)


def is_toppled(state: Any, axis: int) -> bool:
    """Return True if the tilt is beyond the edge."""
    return rotation_matrix(state.motion.attitude)[8] < math.cos(edge(axis))


def state_on_edge(axis: int, angle: float) -> tuple[Any, Any]:
    """Return (parameters, state at rest) with two feet in contact, tilted by an angle [rad]."""
    p, state = state_above_slope(base(axis) * math.sin(angle) + HEIGHT * (math.cos(angle) - 1.0), 0.0)
    return p, state._replace(motion=state.motion._replace(attitude=exp(scale(angle, unit(axis)))))


def topples_at_rest(axis: int, angle: float, step: float = STEP) -> bool:
    """Return True if a vehicle released at rest with a tilt [rad] topples."""
    p, state = state_on_edge(axis, angle)
    return is_toppled(run_on(p, state, SECONDS, step), axis)


def inertia(axis: int) -> float:
    """Return the moment of inertia [kg m^2] about the edge of the feet."""
    return DRONE.mass.inertia[axis] + MASS * (base(axis) ** 2 + HEIGHT**2)


def critical_rate(axis: int) -> float:
    """Return the rate [rad/s] about the edge with the energy to lift the centre of mass over it."""
    return math.sqrt(2.0 * MASS * G * (math.hypot(base(axis), HEIGHT) - HEIGHT) / inertia(axis))


def rest_state() -> tuple[Any, Any]:
    """Return (parameters, state) of the vehicle at rest on all feet, with friction that prevents slip."""
    p, state = state_above_slope(0.0, 0.0, friction_static=GRIP, friction_dynamic=GRIP)
    return p, run_on(p, state, 3.0)


def topples_after_push(axis: int, rest: tuple[Any, Any], rate: float) -> bool:
    """Return True if a vehicle at rest topples after a push at `rate` [rad/s] about the edge of its feet."""
    p, state = rest
    omega = scale(rate, unit(axis))
    arm = (0.0, base(axis), HEIGHT) if axis == 0 else (-base(axis), 0.0, HEIGHT)  # from the edge to the centre
    velocity = tuple(float(v) for v in np.cross(omega, arm))
    motion = state.motion._replace(omega_body=omega, velocity_world=velocity)
    return is_toppled(run_on(p, state._replace(motion=motion), SECONDS / 2.0), axis)


def threshold(topples: Callable[[float], bool], low: float, high: float, bisections: int) -> float:
    """Return the smallest value between `low` and `high` that topples, by bisection."""
    for _ in range(bisections):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if topples(middle) else (middle, high)
    return 0.5 * (low + high)


def baseline(axis: int, angle: float, rate: float = 0.0, step: float = STEP, friction: float = FRICTION) -> np.ndarray:
    """Return tilt [rad] and energy [J] after each step, shape (n, 2), of the baseline from a rate [rad/s].

    Forward Euler on spring, damper and sign friction, in the plane of the fall.
    """
    b, about = base(axis), DRONE.mass.inertia[axis]
    z = b * math.sin(angle) + HEIGHT * math.cos(angle)
    y, vy, vz, omega = 0.0, -rate * HEIGHT, rate * b, rate
    result = []
    for _ in range(round(SECONDS / step)):
        c, s = math.cos(angle), math.sin(angle)
        fy = fz = torque = 0.0
        for side in (-b, b):
            py, pz = side * c + HEIGHT * s, side * s - HEIGHT * c
            depth, depth_rate = -(z + pz), -(vz + omega * py)
            normal_force = max(0.5 * (STIFFNESS * depth + DAMPING * depth_rate), 0.0) if depth > 0.0 else 0.0
            drag = -friction * normal_force * math.copysign(1.0, vy - omega * pz)
            fy, fz, torque = fy + drag, fz + normal_force, torque + py * normal_force - pz * drag
        y, z, angle = y + step * vy, z + step * vz, angle + step * omega
        vy, vz, omega = vy + step * fy / MASS, vz + step * (fz / MASS - G), omega + step * torque / about
        result.append((angle, MASS * (G * z + 0.5 * (vy * vy + vz * vz)) + 0.5 * about * omega * omega))
        if abs(angle) > 0.5 * math.pi:
            break
    return np.array(result)


def baseline_topples(
    axis: int, angle: float, rate: float = 0.0, step: float = STEP, friction: float = FRICTION
) -> bool:
    """Return True if the vehicle topples under the baseline method."""
    return bool(abs(baseline(axis, angle, rate, step, friction)[-1, 0]) > edge(axis))


def energy_gain(axis: int, angle: float) -> float:
    """Return the largest energy gain relative to the energy of the edge."""
    p, state = state_on_edge(axis, angle)
    energies = [energy(p, state.motion)]
    for _ in range(1000):
        state = run_on(p, state, SECONDS / 1000.0)
        energies.append(energy(p, state.motion))
    return (max(energies) - energies[0]) / edge_energy(axis)


def edge_energy(axis: int) -> float:
    """Return the potential energy [J] of the vehicle on its edge, relative to rest."""
    return MASS * G * (math.hypot(base(axis), HEIGHT) - HEIGHT)


def error(axis: int, step: float, topples: Any, bisections: int) -> float:
    """Return the difference [rad] of the toppling angle from the edge for a release at rest."""
    exact = edge(axis)
    return abs(threshold(lambda a: topples(axis, a, step=step), exact - 0.1, exact + 0.1, bisections) - exact)


def push_error(axis: int, topples: Callable[[float], bool], bisections: int) -> float:
    """Return the relative difference of the toppling rate from the rate by energy."""
    exact = critical_rate(axis)
    return abs(threshold(topples, 0.5 * exact, 1.5 * exact, bisections) / exact - 1.0)


def run() -> CaseResult:
    """Measure the toppling angle, the toppling rate, and the energy gain."""
    ours, euler = "friction elements, RK4 at 1 ms", "forward Euler on spring, damper and friction, 1 ms"
    rest = rest_state()
    rate = max(push_error(i, partial(topples_after_push, i, rest), 20) for i in AXES)
    baseline_rate = max(push_error(i, partial(baseline_topples, i, 0.0, friction=GRIP), 16) for i in AXES)
    near_edge = [(i, edge(i) + side) for i in AXES for side in (-NEAR, NEAR)]
    baseline_gain = max(
        float(np.ptp(np.maximum(e[:, 1], e[0, 1]))) / edge_energy(i) for i, a in near_edge for e in (baseline(i, a),)
    )
    rows = [
        Row("leaning", ours, "error of the toppling angle after release at rest, against atan(base / height) [rad]",
            LEAN_BOUND,
            "deviation that grows to 0.1 rad in 5 s; the penetration of the feet has no influence: their force passes "
            "through the centre of mass",
            max(error(i, STEP, topples_at_rest, 34) for i in AXES), euler,
            max(error(i, STEP, baseline_topples, 16) for i in AXES)),
        Row("pushed", ours, "error of the toppling rate from rest, relative to the rate by energy", PUSH_BOUND,
            "energy of the feet's springs and of their penetration, 5 of 8000 mJ",
            rate, euler, baseline_rate),
        Row("energy", ours, f"energy gain after release {NEAR:g} rad to either side, over the energy of the edge",
            ENERGY_BOUND,
            "round-off: the ground adds no energy",
            max(energy_gain(i, a) for i, a in near_edge), euler, baseline_gain),
    ]  # fmt: skip
    return CaseResult(rows, roll_plot())


def roll_plot() -> Plot:
    """Return a plot of the roll of vehicles released slightly to either side of the edge."""
    t = np.arange(251) * 0.02
    curves = []
    for name, off in (("before the edge", -NEAR), ("beyond it", NEAR)):
        p, state = state_on_edge(0, edge(0) + off)
        angles = [edge(0) + off]
        for _ in t[1:]:
            state = run_on(p, state, 0.02)
            angles.append(2.0 * math.atan2(state.motion.attitude[1], state.motion.attitude[0]))
        plain = baseline(0, edge(0) + off)[:, 0][::20]
        curves += [Curve(name, t, np.array(angles)), Curve(f"{name}, Euler", t[: len(plain)], plain)]
    return Plot("time [s]", "roll [rad]", curves, log_y=False)


def sweep() -> Sweep:
    """Increase the step: error of the toppling angle."""
    steps = STEP * np.array([0.125, 0.25, 0.5, 1.0, 2.0, 4.0])
    curves = [
        Curve("RK4, feet of the plant", steps, np.array([error(1, h, topples_at_rest, 34) for h in steps])),
        Curve("forward Euler", steps, np.array([error(1, h, baseline_topples, 16) for h in steps])),
    ]
    return Sweep("step [s]", "error of the toppling angle [rad]", LEAN_BOUND, curves)
