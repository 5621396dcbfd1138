"""Case 24: 1e8 steps of a body that tumbles about its intermediate axis, and ten hours of rest."""

import numpy as np

from lapwing.dynamics.lie.quaternion import NO_ROTATION
from lapwing.dynamics.vehicles.rigid_body import FreeBodyParameters, RigidBody
from lapwing.studies.stability.case_result import CaseResult, Curve, Plot, Row
from lapwing.studies.stability.cases.landing import baseline_rest, drift_at_rest
from lapwing.studies.stability.sampled_runs import drift, run_fixed_steps

HARD = "1e8 steps of a tumbling body, ten hours of rest: round-off must not add up in one direction"
LONG = True

STEPS, STEP, SAMPLES = 100_000_000, 1e-3, 100
BOUND = 2e-8
INERTIA, OMEGA = (0.27, 0.26, 0.42), (0.3, 2.0, 0.1)  # [kg m^2], [rad/s]


def changes(method: str, steps: int) -> np.ndarray:
    """Return the relative change of the energy at equal parts of a run."""
    y = run_fixed_steps(
        method, FreeBodyParameters(INERTIA), RigidBody(NO_ROTATION, OMEGA), steps * STEP, steps, SAMPLES
    )
    return drift(y[:, 9:12] ** 2 @ np.array(INERTIA)[:, None])


def run() -> CaseResult:
    """Measure the energy, which is constant without torque, and the motion at rest."""
    ours, baseline = changes("rigid_splitting", STEPS), changes("lie_euler", STEPS // 1000)
    rows = [
        Row("energy", "rigid_splitting, 1 ms", "change of the energy in 1e8 steps, relative", BOUND,
            "round-off of 2e-16 in each step, all of one sign", float(ours.max()),
            "Lie-Euler, a thousandth of the steps", float(baseline.max())),
        Row("rest", "friction elements, RK4 at 1 ms", "motion [m] in ten hours of rest", 1e-9,
            "as for an hour in case 9", drift_at_rest(36_000.0, 0.0),
            "forward Euler on spring and damper, 1 ms, in a second", baseline_rest()),
    ]  # fmt: skip
    t = np.linspace(0.0, STEPS * STEP, SAMPLES + 1)
    return CaseResult(rows, Plot("time [s]", "change of the energy", [Curve("rigid_splitting", t, ours)], BOUND))
