"""Case 11: every integrator at the edge of its stability, and beyond."""

import numpy as np

from lapwing.dynamics import integrators
from lapwing.dynamics.lie.quaternion import NO_ROTATION
from lapwing.dynamics.vehicles.rigid_body import RigidBody
from lapwing.studies.accuracy.systems.gyrostat import BLOCKED
from lapwing.studies.stability.case_result import CaseResult, Curve, Row, Sweep
from lapwing.studies.stability.sampled_runs import rows

HARD = "steps at the edge of the stability of each integrator, on a damped spin of rate 1, and beyond it"

SPIN = BLOCKED._replace(damping=BLOCKED.inertia[2])  # omega_3' = -omega_3
START = RigidBody(NO_ROTATION, (0.0, 0.0, 1.0))
KICKED = "rigid_splitting"  # takes no torque that depends on the rate
INSIDE, BEYOND = 0.95, 1.3  # of the edge
LONG, GROWN = 2000, 20_000  # steps: until a spin must be gone, until what grows is beyond all numbers


def methods() -> list[str]:
    """Return the integrators that support this system."""
    return [name for name in integrators.names() if name != KICKED]


def spin(method: str, step: float, steps: int) -> float:
    """Return the size of the spin after so many steps; NaN if it is not finite."""
    return abs(float(rows(method, SPIN, START, steps * step, steps, 1)[-1, 6]))


def edge(method: str) -> float:
    """Return the maximum step that reduces the spin, by bisection."""
    low, high = 0.5, 16.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if spin(method, middle, 1) < 1.0 else (low, middle)
    return low


def silent(method: str, step: float) -> float:
    """Return 1 if a diverged run raises no error, 0 if the error names time, system and value."""
    try:
        integrators.simulate(integrators.get(method), SPIN, START, step, GROWN, GROWN)
    except ValueError as error:
        return 0.0 if f"with step {step:g}" in str(error) and "t = " in str(error) else 1.0
    return 1.0


def run() -> CaseResult:
    """Measure steps just below and above the stability limit."""
    names = methods()
    edges = np.array([edge(name) for name in names])
    inside = np.array([spin(name, INSIDE * h, LONG) for name, h in zip(names, edges, strict=True)])
    quiet = sum(silent(name, BEYOND * h) for name, h in zip(names, edges, strict=True))
    widest = float(edges.max())
    with np.errstate(over="ignore"):
        baseline = np.abs(1.0 - INSIDE * widest) ** 100.0
        unchecked = sum(np.isinf(np.float64(BEYOND * h) ** GROWN) for h in edges)
    result = [
        Row(
            "edge",
            f"all {len(names)} integrators at 0.95 of their own edge",
            f"spin left after {LONG} steps, of 1",
            1.0,
            "inside of its stability region a method damps what is damped",
            float(inside.max()),
            f"forward Euler at the widest of these steps, {INSIDE * widest:.3g}, 100 of them",
            float(baseline),
        ),
        Row(
            "beyond",
            "`simulate` at 1.3 of the edge",
            "integrators that end in no number without a word",
            0.0,
            "never NaN in silence",
            quiet,
            "the same growth in plain floats",
            float(unchecked),
        ),
    ]
    walked = sweep()
    return CaseResult(result, walked.plot())


def sweep() -> Sweep:
    """Increase the step."""
    steps = np.geomspace(0.25, 8.0, 41)
    curves = [Curve(name, steps, np.array([spin(name, float(h), 200) for h in steps])) for name in methods()]
    return Sweep("step times rate", "spin left after 200 steps, of 1", 1.0, curves)
