"""Case 3: ten hours of gyrostat."""

import math

import numpy as np

from lapwing.dynamics.integrators import get, integrate_fixed
from lapwing.kernels.state_tree import flatten
from lapwing.studies.accuracy.reference import attitude_rate
from lapwing.studies.accuracy.systems.gyrostat import SPINNING, START
from lapwing.studies.stability.case_result import CaseResult, Curve, Plot, Row
from lapwing.studies.stability.sampled_runs import rows, run_fixed_steps, worst

HARD = "ten hours of gyrostat, 60 000 steps, chaotic: an attitude must stay one, the order its own, the bits the same"

DURATION, STEPS, SAMPLES = 600.0, 60_000, 600  # [min]
SHORT, COARSE = 30.0, 600  # of the order
DIGITS = 1e-12


def defect(R: np.ndarray) -> np.ndarray:
    """Return the largest entry of R^T R - 1, shape (k,), of matrices in row order, shape (k, 9)."""
    m = R.reshape(-1, 3, 3)
    return np.abs(np.einsum("kji,kjl->kil", m, m) - np.eye(3)).max(axis=(1, 2))


def on_entries() -> np.ndarray:
    """Integrate the matrix entries by forward Euler (baseline), under the true rates, shape (SAMPLES + 1, 9)."""
    omega = run_fixed_steps("rkmk4", SPINNING, START, DURATION, STEPS, STEPS)[:, 9:]
    R, h, result = np.eye(3).ravel(), DURATION / STEPS, []
    for i in range(STEPS + 1):
        if i % (STEPS // SAMPLES) == 0:
            result.append(R)
        R = R + h * attitude_rate(R, omega[i])
    return np.array(result)


def order(method: str) -> float:
    """Return the observed order from three halvings of the step."""
    ends = [run_fixed_steps(method, SPINNING, START, SHORT, COARSE * 2**k, 1)[-1] for k in range(3)]
    return math.log2(worst(ends[1] - ends[0]) / worst(ends[2] - ends[1]))


def final_state_in_parts() -> np.ndarray:
    """Return the final state if each of ten parts starts at the accumulated clock of the previous one."""
    x, t, h = START, 0.0, DURATION / STEPS
    for _ in range(10):
        x = integrate_fixed(get("rkmk4").Method(), SPINNING, t, x, h, STEPS // 10)
        for _ in range(STEPS // 10):
            t += h
    return np.array(flatten(x))


def run() -> CaseResult:
    """Check orthogonality, order, and bit-for-bit identical results for any recording interval."""
    ours = run_fixed_steps("rkmk4", SPINNING, START, DURATION, STEPS, SAMPLES)
    baseline = on_entries()
    t = np.linspace(0.0, DURATION, SAMPLES + 1)
    off, baseline_off = defect(ours[:, :9]), defect(baseline)
    ends = [rows("rkmk4", SPINNING, START, DURATION, STEPS, n)[-1] for n in (1, 60)]
    figures = [
        Row(
            "orthogonality",
            "rkmk4, 0.01 min",
            "R^T R - 1, largest entry",
            DIGITS,
            "round-off: a few units in the last place, which must not add up over 60 000 steps",
            worst(off),
            "forward Euler on the matrix entries",
            worst(baseline_off),
        ),
        Row(
            "order",
            "rkmk4",
            "four less the observed order",
            0.2,
            "what two halvings leave of the leading term",
            abs(4.0 - order("rkmk4")),
            "forward Euler on the numbers",
            abs(4.0 - order("euler")),
        ),
        Row(
            "bits",
            "time as a count of steps",
            "difference of two runs of ten hours, one recorded more often",
            0.0,
            "the same bits: a chaotic run can be repeated in no other way",
            worst(ends[0] - ends[1]),
            "time as a sum of steps, in ten parts",
            worst(final_state_in_parts() - ends[0]),
        ),
    ]
    curves = [Curve("rkmk4", t, np.maximum(off, 1e-17)), Curve("Euler on entries", t, baseline_off)]
    return CaseResult(figures, Plot("time [min]", "largest entry of R^T R - 1", curves, DIGITS))
