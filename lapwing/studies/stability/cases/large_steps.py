"""Case 11: every integrator at its stability limit, and beyond."""

import numpy as np

from lapwing.dynamics import integrators
from lapwing.dynamics.lie.quaternion import NO_ROTATION
from lapwing.dynamics.vehicles.rigid_body import RigidBody
from lapwing.studies.accuracy.systems.gyrostat import BLOCKED
from lapwing.studies.stability.case_result import CaseResult, Curve, Row, Sweep
from lapwing.studies.stability.sampled_runs import rows

HARD = "steps at the stability limit of each integrator and beyond, for a damped spin with rate 1"

SPIN = BLOCKED._replace(damping=BLOCKED.inertia[2])  # omega_3' = -omega_3
START = RigidBody(NO_ROTATION, (0.0, 0.0, 1.0))
UNSUPPORTED = "rigid_splitting"  # supports no torque that depends on the angular velocity
INSIDE, BEYOND = 0.95, 1.3  # of the stability limit
DECAY_STEPS, GROWTH_STEPS = 2000, 20_000  # steps: until a spin has decayed; until a growing one has overflowed


def methods() -> list[str]:
    """Return the integrators that support this system."""
    return [name for name in integrators.names() if name != UNSUPPORTED]


def spin(method: str, step: float, steps: int) -> float:
    """Return the absolute value of the spin after `steps` steps; NaN if it is not finite."""
    return abs(float(rows(method, SPIN, START, steps * step, steps, 1)[-1, 6]))


def edge(method: str) -> float:
    """Return the largest step that reduces the spin, by bisection."""
    low, high = 0.5, 16.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if spin(method, middle, 1) < 1.0 else (low, middle)
    return low


def is_silent(method: str, step: float) -> float:
    """Return 1 if a diverged run raises no error, 0 if the error names time, system and value."""
    try:
        integrators.simulate(integrators.get(method), SPIN, START, step, GROWTH_STEPS, GROWTH_STEPS)
    except ValueError as error:
        return 0.0 if f"with step {step:g}" in str(error) and "t = " in str(error) else 1.0
    return 1.0


def run() -> CaseResult:
    """Measure steps below and above the stability limit."""
    names = methods()
    edges = np.array([edge(name) for name in names])
    inside = np.array([spin(name, INSIDE * h, DECAY_STEPS) for name, h in zip(names, edges, strict=True)])
    silent_count = sum(is_silent(name, BEYOND * h) for name, h in zip(names, edges, strict=True))
    widest = float(edges.max())
    with np.errstate(over="ignore"):
        baseline = np.abs(1.0 - INSIDE * widest) ** 100.0
        unchecked = sum(np.isinf(np.float64(BEYOND * h) ** GROWTH_STEPS) for h in edges)
    result = [
        Row("edge", f"all {len(names)} integrators at 0.95 of their limit", f"spin after {DECAY_STEPS} steps, relative",
            1.0, "inside its stability region a method damps the spin", float(inside.max()),
            f"forward Euler with 100 steps of {INSIDE * widest:.3g}, the largest of these", float(baseline)),
        Row("beyond", "`simulate` at 1.3 of the limit", "integrators with a non-finite state and no error", 0.0,
            "every non-finite state raises an error", silent_count, "the same growth without a check",
            float(unchecked)),
    ]  # fmt: skip
    return CaseResult(result, sweep().plot())


def sweep() -> Sweep:
    """Increase the step."""
    steps = np.geomspace(0.25, 8.0, 41)
    curves = [Curve(name, steps, np.array([spin(name, float(h), 200) for h in steps])) for name in methods()]
    return Sweep("step times rate", "spin after 200 steps, relative", 1.0, curves)
