"""Case 2: free tumbling about the intermediate axis, next to the separatrix."""

import math

import numpy as np
from scipy.special import ellipj, ellipk

from lapwing.dynamics.lie.quaternion import exp
from lapwing.dynamics.vehicles.rigid_body import FreeBodyParameters, RigidBody
from lapwing.studies.accuracy.reference import to_world
from lapwing.studies.stability.case_result import CaseResult, Curve, Plot, Row, Sweep
from lapwing.studies.stability.sampled_runs import drift, run_fixed_steps

HARD = "1000 s of tumbling about the intermediate axis (Dzhanibekov effect): every flip amplifies an energy error"

INERTIA = (1.0, 1.6, 2.1)  # [kg m^2]
EPSILON = 1e-2  # [rad/s] component off the intermediate axis: distance to the separatrix
DURATION, STEPS, SAMPLES = 1000.0, 200_000, 500
INVARIANT_BOUND = 1e-11


def initial_state(epsilon: float) -> RigidBody:
    """Return a rotation about the intermediate axis with a small component about the largest one."""
    return RigidBody(exp((0.3, -0.5, 0.2)), (0.0, 1.0, epsilon))


def closed_form(epsilon: float, t: np.ndarray) -> np.ndarray:
    """Return omega_body at times t [s], shape (k, 3), with omega_2 maximum at t = 0 (eqs. (7.2) to (7.5))."""
    A, B, C = INERTIA
    square, twice = B * B + (C * epsilon) ** 2, B + C * epsilon**2  # of the momentum; twice the energy
    # twice the energy times B is below the square: the side of the separatrix around the axis of the largest moment
    a1 = math.sqrt((twice * C - square) / (A * (C - A)))
    a2 = math.sqrt((twice * C - square) / (B * (C - B)))
    a3 = math.sqrt((square - twice * A) / (C * (C - A)))
    rate = math.sqrt((C - B) * (square - twice * A) / (A * B * C))
    # 1 - m is computed from the small number, because the difference of two nearly equal terms would cancel
    complement = (C - A) * C * (C - B) * epsilon**2 / ((C - B) * (square - twice * A))
    m = 1.0 - complement
    sn, cn, dn, _ = ellipj(rate * t + ellipk(m), m)
    return np.column_stack([a1 * cn, a2 * sn, a3 * dn])


def figures(method: str, epsilon: float, steps: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (largest error of the rates so far [rad/s], relative drift of energy, of momentum), shape (k,) each."""
    return figures_of_run(
        run_fixed_steps(method, FreeBodyParameters(INERTIA), initial_state(epsilon), DURATION, steps, SAMPLES), epsilon
    )


def figures_of_run(y: np.ndarray, epsilon: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the `figures` of a run; `y` has R_world_body and omega_body at every sample, shape (k, 12)."""
    t = np.linspace(0.0, DURATION, SAMPLES + 1)
    off = np.abs(y[:, 9:12] - closed_form(epsilon, t)).max(axis=1)
    energy = drift(0.5 * (y[:, 9:12] ** 2 * INERTIA).sum(axis=1))
    return np.maximum.accumulate(off), energy, drift(to_world(y[:, :9], y[:, 9:12] * INERTIA))


def run() -> CaseResult:
    """Compare the rates with the closed form, and measure both invariants."""
    off, energy, momentum = figures("rigid_splitting", EPSILON, STEPS)
    baseline_off, baseline_energy, baseline_momentum = figures("lie_euler", EPSILON, STEPS)
    t = np.linspace(0.0, DURATION, SAMPLES + 1)
    method, baseline = "rigid_splitting, 5 ms", "Lie-Euler, 5 ms"
    rows = [
        Row("rates", method, "error of the body rates against Jacobi's functions [rad/s]", 1e-7,
            "round-off of the energy, 1e-14, times the sensitivity of the period near the separatrix, 1 / epsilon^2, "
            "times the 1000 rad of the run",
            float(off.max()), baseline, float(baseline_off.max())),
        Row("energy", method, "change of the kinetic energy, relative", INVARIANT_BOUND,
            "round-off of 2e-16 in each of 200 000 steps, all of one sign", float(energy.max()), baseline,
            float(baseline_energy.max())),
        Row("momentum", method, "change of the angular momentum in the world, relative", INVARIANT_BOUND,
            "as for `energy`", float(momentum.max()), baseline, float(baseline_momentum.max())),
    ]  # fmt: skip
    curves = [Curve("rigid_splitting", t, off), Curve("Lie-Euler", t, baseline_off)]
    return CaseResult(rows, Plot("time [s]", "largest error of the rates so far [rad/s]", curves, 1e-7))


def sweep() -> Sweep:
    """Increase the step."""
    counts = [200_000, 100_000, 40_000, 20_000, 8000, 4000, 2000, 1000, 500]
    steps = DURATION / np.array(counts)
    curves = [
        Curve(name, steps, np.array([figures(name, EPSILON, n)[0].max() for n in counts]))
        for name in ("rigid_splitting", "rkmk4", "cf4", "implicit_lie_midpoint", "rk4_renormalised", "lie_euler")
    ]
    return Sweep("step [s]", "error of the rates after 1000 s [rad/s]", 1e-3, curves)
