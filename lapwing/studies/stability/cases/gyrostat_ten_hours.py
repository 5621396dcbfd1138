"""Case 3: ten hours of gyrostat."""

import math

import numpy as np

from lapwing.dynamics.integrators import get, integrate_fixed
from lapwing.kernels.state_tree import flatten
from lapwing.studies.accuracy.reference import attitude_rate
from lapwing.studies.accuracy.systems.gyrostat import SPINNING, START
from lapwing.studies.stability.case_result import CaseResult, Curve, Plot, Row
from lapwing.studies.stability.sampled_runs import rows, run_fixed_steps, worst

HARD = "ten hours of a chaotic gyrostat, 60 000 steps: orthogonal attitude, order of convergence, identical bits"

DURATION, STEPS, SAMPLES = 600.0, 60_000, 600  # [min]
ORDER_DURATION, ORDER_STEPS = 30.0, 600  # [min], steps: for the order of convergence
ORTHOGONALITY = 1e-12


def defect(R: np.ndarray) -> np.ndarray:
    """Return the largest entry of R^T R - 1, shape (k,), for row-major matrices, shape (k, 9)."""
    m = R.reshape(-1, 3, 3)
    return np.abs(np.einsum("kji,kjl->kil", m, m) - np.eye(3)).max(axis=(1, 2))


def euler_on_entries() -> np.ndarray:
    """Return matrix entries integrated by forward Euler under the true rates (baseline), shape (SAMPLES + 1, 9)."""
    omega = run_fixed_steps("rkmk4", SPINNING, START, DURATION, STEPS, STEPS)[:, 9:]
    R, h, result = np.eye(3).ravel(), DURATION / STEPS, []
    for i in range(STEPS + 1):
        if i % (STEPS // SAMPLES) == 0:
            result.append(R)
        R = R + h * attitude_rate(R, omega[i])
    return np.array(result)


def order(method: str) -> float:
    """Return the observed order of convergence from two halvings of the step."""
    ends = [run_fixed_steps(method, SPINNING, START, ORDER_DURATION, ORDER_STEPS * 2**k, 1)[-1] for k in range(3)]
    return math.log2(worst(ends[1] - ends[0]) / worst(ends[2] - ends[1]))


def final_state_in_parts() -> np.ndarray:
    """Return the final state of a run in ten parts, each from the accumulated clock of the previous one (baseline)."""
    x, t, h = START, 0.0, DURATION / STEPS
    for _ in range(10):
        x = integrate_fixed(get("rkmk4").Method(), SPINNING, t, x, h, STEPS // 10)
        for _ in range(STEPS // 10):
            t += h
    return np.array(flatten(x))


def run() -> CaseResult:
    """Check orthogonality, order, and bit-for-bit identical results for any recording interval."""
    ours = run_fixed_steps("rkmk4", SPINNING, START, DURATION, STEPS, SAMPLES)
    baseline = euler_on_entries()
    t = np.linspace(0.0, DURATION, SAMPLES + 1)
    off, baseline_off = defect(ours[:, :9]), defect(baseline)
    ends = [rows("rkmk4", SPINNING, START, DURATION, STEPS, n)[-1] for n in (1, 60)]
    figures = [
        Row("orthogonality", "rkmk4, 0.01 min", "R^T R - 1, largest entry", ORTHOGONALITY,
            "round-off: a few units in the last place, which must not add up over 60 000 steps", worst(off),
            "forward Euler on the matrix entries", worst(baseline_off)),
        Row("order", "rkmk4", "difference of the observed order from four", 0.2,
            "higher-order terms after two halvings of the step", abs(4.0 - order("rkmk4")),
            "forward Euler on the coordinates", abs(4.0 - order("euler"))),
        Row("bits", "time from the step count", "difference of two runs with different recording intervals", 0.0,
            "a chaotic run is repeatable only if all bits are identical", worst(ends[0] - ends[1]),
            "time as a sum of steps, run in ten parts", worst(final_state_in_parts() - ends[0])),
    ]  # fmt: skip
    curves = [Curve("rkmk4", t, np.maximum(off, 1e-17)), Curve("Euler on entries", t, baseline_off)]
    return CaseResult(figures, Plot("time [min]", "largest entry of R^T R - 1", curves, ORTHOGONALITY))
