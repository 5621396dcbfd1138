"""Case 9, its toppling: a vehicle that is set down leaning, or pushed, over the edge of its feet."""

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

HARD = (
    "a vehicle that leans, or is pushed, over the edge of its feet: it falls or comes back by a billionth of a radian"
)

MASS, FEET = DRONE.mass.total, DRONE.contact.feet if DRONE.contact else ()
AXES = (0, 1)  # roll, pitch
SECONDS = 5.0  # in which what is off its balance by 1e-9 rad has grown to a tenth: 4.5 or 4.7 e-folds a second
FRICTION, GRIP = 0.5, 2.0  # coefficients: of the effect, and so that pushed feet do not slide
NEAR = 1e-4  # [rad] beside the edge
EXACT, PUSHED, GAINED = 1e-9, 1e-3, 1e-9


def base(axis: int) -> float:
    """Return half the distance [m] between the feet of the tilt axis."""
    return float(max(foot[1 - axis] for foot in FEET))


def edge(axis: int) -> float:
    """Return the angle [rad] at which the centre of mass is above the feet.

    The ground force then passes through it at any foot depth: the springs do not move the edge.
    """
    return math.atan(base(axis) / HEIGHT)


def unit(axis: int) -> tuple[float, float, float]:
    """Return the unit vector of the body's axis x (0) or y (1)."""
    return (1.0, 0.0, 0.0) if axis == 0 else (0.0, 1.0, 0.0)


def is_toppled(state: Any, axis: int) -> bool:
    """Return True if it leans over its edge."""
    return rotation_matrix(state.motion.attitude)[8] < math.cos(edge(axis))


def state_on_edge(axis: int, angle: float) -> tuple[Any, Any]:
    """Return (parameters, state at rest) on two feet, which just touch, leaning by an angle [rad]."""
    p, state = state_above_slope(base(axis) * math.sin(angle) + HEIGHT * (math.cos(angle) - 1.0), 0.0)
    return p, state._replace(motion=state.motion._replace(attitude=exp(scale(angle, unit(axis)))))


def falls(axis: int, angle: float, step: float = STEP) -> bool:
    """Return True if a vehicle that is set down leaning topples."""
    p, state = state_on_edge(axis, angle)
    return is_toppled(run_on(p, state, SECONDS, step), axis)


def inertia(axis: int) -> float:
    """Return the moment [kg m^2] about the edge of the feet."""
    return DRONE.mass.inertia[axis] + MASS * (base(axis) ** 2 + HEIGHT**2)


def enough(axis: int) -> float:
    """Return the rate [rad/s] about the edge whose energy lifts the centre of mass over it."""
    return math.sqrt(2.0 * MASS * G * (math.hypot(base(axis), HEIGHT) - HEIGHT) / inertia(axis))


def rest_state() -> tuple[Any, Any]:
    """Return (parameters, state) of the vehicle at rest on all feet, which do not slide."""
    p, state = state_above_slope(0.0, 0.0, friction_static=GRIP, friction_dynamic=GRIP)
    return p, run_on(p, state, 3.0)


def topples_after_push(axis: int, rest: tuple[Any, Any], rate: float) -> bool:
    """Return True if a standing vehicle that is pushed about the edge of its feet topples."""
    p, state = rest
    omega = scale(rate, unit(axis))
    arm = (0.0, base(axis), HEIGHT) if axis == 0 else (-base(axis), 0.0, HEIGHT)  # from the edge to the middle
    velocity = tuple(float(v) for v in np.cross(omega, arm))
    motion = state.motion._replace(omega_body=omega, velocity_world=velocity)
    return is_toppled(run_on(p, state._replace(motion=motion), SECONDS / 2.0), axis)


def threshold(topples: Callable[[float], bool], low: float, high: float, parts: int) -> float:
    """Return the value between two others at which it begins to topple, by bisection."""
    for _ in range(parts):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if topples(middle) else (middle, high)
    return 0.5 * (low + high)


def baseline(axis: int, angle: float, rate: float = 0.0, step: float = STEP, friction: float = FRICTION) -> np.ndarray:
    """Return rows of (angle [rad], energy [J]), shape (n, 2), of the baseline; `rate` [rad/s] about the edge.

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
            deep, sinking = -(z + pz), -(vz + omega * py)
            press = max(0.5 * (STIFFNESS * deep + DAMPING * sinking), 0.0) if deep > 0.0 else 0.0
            drag = -friction * press * math.copysign(1.0, vy - omega * pz)
            fy, fz, torque = fy + drag, fz + press, torque + py * press - pz * drag
        y, z, angle = y + step * vy, z + step * vz, angle + step * omega
        vy, vz, omega = vy + step * fy / MASS, vz + step * (fz / MASS - G), omega + step * torque / about
        result.append((angle, MASS * (G * z + 0.5 * (vy * vy + vz * vz)) + 0.5 * about * omega * omega))
        if abs(angle) > 0.5 * math.pi:
            break
    return np.array(result)


def baseline_falls(axis: int, angle: float, rate: float = 0.0, step: float = STEP, friction: float = FRICTION) -> bool:
    """Return True if it topples under the baseline method."""
    return bool(abs(baseline(axis, angle, rate, step, friction)[-1, 0]) > edge(axis))


def energy_gain(axis: int, angle: float) -> float:
    """Return the maximum energy over the initial one, relative to the energy of the edge over rest."""
    p, state = state_on_edge(axis, angle)
    energies = [energy(p, state.motion)]
    for _ in range(1000):
        state = run_on(p, state, SECONDS / 1000.0)
        energies.append(energy(p, state.motion))
    return (max(energies) - energies[0]) / lift(axis)


def lift(axis: int) -> float:
    """Return the energy [J] of the centre of mass above the edge, relative to rest."""
    return MASS * G * (math.hypot(base(axis), HEIGHT) - HEIGHT)


def error(axis: int, step: float, topples: Any, parts: int) -> float:
    """Return the difference [rad] between toppling angle and edge for a vehicle released at rest."""
    exact = edge(axis)
    return abs(threshold(lambda a: topples(axis, a, step=step), exact - 0.1, exact + 0.1, parts) - exact)


def push_error(axis: int, topples: Callable[[float], bool], parts: int) -> float:
    """Return the relative difference of the toppling rate from that of the energy."""
    exact = enough(axis)
    return abs(threshold(topples, 0.5 * exact, 1.5 * exact, parts) / exact - 1.0)


def run() -> CaseResult:
    """Set down leaning, pushed, and what becomes of the energy."""
    ours, euler = "friction elements, RK4 at 1 ms", "forward Euler on spring, damper and friction, 1 ms"
    rest = rest_state()
    rate = max(push_error(i, partial(topples_after_push, i, rest), 20) for i in AXES)
    baseline_rate = max(push_error(i, partial(baseline_falls, i, 0.0, friction=GRIP), 16) for i in AXES)
    beside = [(i, edge(i) + side) for i in AXES for side in (-NEAR, NEAR)]
    kicked = max(float(np.ptp(np.maximum(e[:, 1], e[0, 1]))) / lift(i) for i, a in beside for e in (baseline(i, a),))
    rows = [
        Row("leaning", ours, "angle at which it topples, set down at rest, less atan(base / height) [rad]", EXACT,
            "what grows to a tenth of a radian in 5 s; the depth of the feet does not enter: their force goes "
            "through the centre of mass",
            max(error(i, STEP, falls, 34) for i in AXES), euler, max(error(i, STEP, baseline_falls, 16) for i in AXES)),
        Row("pushed", ours, "rate at which it topples, standing, relative to that of equal energies", PUSHED,
            "the energy of the feet's springs and of their depth, 5 of 8000 mJ",
            rate, euler, baseline_rate),
        Row("energy", ours, f"energy gained, set down {NEAR:g} rad to either side, over that of the edge", GAINED,
            "none but round-off: the ground adds no energy",
            max(energy_gain(i, a) for i, a in beside), euler, kicked),
    ]  # fmt: skip
    return CaseResult(rows, course())


def course() -> Plot:
    """Plot the roll of vehicles released slightly to either side of the edge."""
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
        Curve("RK4, feet of the plant", steps, np.array([error(1, h, falls, 34) for h in steps])),
        Curve("forward Euler", steps, np.array([error(1, h, baseline_falls, 16) for h in steps])),
    ]
    return Sweep("step [s]", "error of the angle at which it topples [rad]", EXACT, curves)
