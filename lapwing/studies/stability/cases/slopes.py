"""Case 18: slopes up to the friction angle and beyond, bumps, a touchdown on one foot."""

import math
from typing import Any

import numpy as np

from lapwing.dynamics.lie.quaternion import exp, multiply
from lapwing.studies.stability.case_result import CaseResult, Curve, Row, Sweep
from lapwing.studies.stability.cases.landing import STEP, G, baseline_restitution, run_on, state_above_slope

HARD = "slopes up to the friction angle, with unevenly loaded feet, and beyond; bumps; a touchdown on one foot"

STATIC, DYNAMIC = 0.5, 0.3  # coefficients of the effect
# The uphill feet carry less load and slip first, by hundredths of a millimetre, but still hold by mu_s
EDGE = math.degrees(math.atan(STATIC))  # 26.6
MARGIN = 1.0  # [degrees] below it: after a sudden release the feet overshoot
REST, SLIDE = 1e-6, 1e-3  # [m], relative


def distance(degrees: float, seconds: float = 60.0) -> float:
    """Return the motion [m] of a vehicle at rest on a slope [degrees] in a time [s]."""
    # held by high friction until the springs along the slope carry the weight, then released
    model, state = state_above_slope(0.0, 0.0, math.radians(degrees), friction_static=5.0)
    state = run_on(model, state, 3.0)
    p, _ = state_above_slope(0.0, 0.0, math.radians(degrees))
    state = run_on(p, state, 3.0)  # the uphill feet slip by hundredths of a millimetre and stick again
    later = run_on(p, state, seconds).motion
    return float(np.linalg.norm(np.subtract(later.position_world, state.motion.position_world)))


def chatter_distance(degrees: float, seconds: float = 60.0) -> float:
    """Return the motion [m] under sign friction and forward Euler at the plant's step (baseline)."""
    a, x, v = math.radians(degrees), 0.0, 0.0
    for _ in range(round(seconds / STEP)):
        v += STEP * G * (math.sin(a) - STATIC * math.cos(a) * math.copysign(1.0, v))
        x += STEP * v
    return abs(x)


def slide_acceleration(degrees: float) -> float:
    """Return the downhill acceleration [m/s^2] of a slide on a slope [degrees]."""
    a = math.radians(degrees)
    p, state = state_above_slope(0.0, 0.0, a)
    early = run_on(p, state, 0.3)
    late = run_on(p, early, 0.5)
    down = np.array([0.0, -math.cos(a), -math.sin(a)])
    return float(np.subtract(late.motion.velocity_world, early.motion.velocity_world) @ down / 0.5)


def energy(p: Any, m: Any) -> float:
    """Return the kinetic and potential energy [J] of a vehicle with parameters p and motion m."""
    spin = np.dot(p.body.inertia, np.square(m.omega_body))
    return float(
        p.body.mass * (G * m.position_world[2] + np.dot(m.velocity_world, m.velocity_world) / 2.0) + spin / 2.0
    )


def one_foot() -> float:
    """Return the largest energy over the initial one, minus one, of a touchdown on one foot at 1 m/s."""
    p, state = state_above_slope(0.1, 1.0)
    m = state.motion
    state = state._replace(motion=m._replace(attitude=multiply(m.attitude, exp((0.15, -0.12, 0.3)))))
    energies = [energy(p, state.motion)]
    for _ in range(500):
        state = run_on(p, state, 4e-3)
        energies.append(energy(p, state.motion))
    return max(energies) / energies[0] - 1.0


def bumps() -> float:
    """Return the motion [m] in a minute of rest on bumps of 2 cm."""
    p, state = state_above_slope(0.1, 0.0, ground={"bump_height": 0.02, "bump_length": 0.7})
    state = run_on(p, state, 3.0)
    later = run_on(p, state, 60.0).motion
    return float(np.linalg.norm(np.subtract(later.position_world, state.motion.position_world)))


def run() -> CaseResult:
    """Measure sticking, sliding, a touchdown on one foot, and rest on bumps."""
    below, beyond = EDGE - MARGIN, 30.0
    a = math.radians(beyond)
    exact = G * (math.sin(a) - DYNAMIC * math.cos(a))
    one_coefficient = G * (math.sin(a) - STATIC * math.cos(a))
    sign, anchored = "sign friction", "friction elements, RK4 at 1 ms"
    gain = max(baseline_restitution(1.0, phase / 8, STEP) for phase in range(8)) ** 2 - 1.0
    no_slip = "a thousandth of a millimetre: the feet stick"
    off, baseline_off = abs(slide_acceleration(beyond) / exact - 1.0), abs(one_coefficient / exact - 1.0)
    rows = [
        Row("below", anchored, f"motion [m] in a minute at {below:.1f} degrees", REST, no_slip,
            distance(below), sign, chatter_distance(below)),
        Row("beyond", anchored, "error of the acceleration on 30 degrees, relative to g (sin - mu cos)", SLIDE,
            "remaining oscillation of the feet's springs after 0.3 s", off,
            "one coefficient for static and dynamic friction", baseline_off),
        Row("one_foot", anchored, "energy gain of a touchdown on one foot, relative", 1e-9,
            "round-off: the ground adds no energy", one_foot(), "forward Euler on spring and damper, upright", gain),
        Row("bumps", anchored, "motion [m] in a minute on bumps of 2 cm", REST, no_slip,
            bumps(), sign, chatter_distance(5.0)),
    ]  # fmt: skip
    return CaseResult(rows, sweep().plot())


def sweep() -> Sweep:
    """Increase the slope."""
    angles = np.array([5.0, 10.0, 15.0, 20.0, 22.0, 22.5, 23.0, 23.5, 24.0, 25.0, 26.0, 26.5, 26.7, 28.0])
    methods = {"friction elements": distance, "sign friction": chatter_distance}
    curves = [Curve(name, angles, np.maximum([f(float(d), 5.0) for d in angles], 1e-17)) for name, f in methods.items()]
    return Sweep(f"slope [degrees], friction angle {EDGE:.1f}", "motion in 5 s [m]", REST, curves, log_x=False)
