"""Case 5: bodies with extremely different, or nearly equal, moments of inertia."""

import numpy as np

from lapwing.dynamics.lie.quaternion import exp
from lapwing.dynamics.vehicles.rigid_body import FreeBodyParameters, RigidBody
from lapwing.studies.accuracy.reference import to_world
from lapwing.studies.accuracy.systems.free_rigid_body import closed_form
from lapwing.studies.stability.case_result import CaseResult, Curve, Plot, Row, Sweep
from lapwing.studies.stability.sampled_runs import drift, run_fixed_steps

HARD = "a needle (one moment a millionth of the others), a flat plate, a body spherical to 1e-9"

BODIES = {"needle": ((1e-6, 1.0, 1.0 + 7e-7), (400.0, 1.0, -0.7)), "flat": ((1e-6, 1.0, 1.0 + 1e-6), (50.0, -0.3, 2.0))}
ATTITUDE = exp((0.3, -0.5, 0.2))
SPHERICAL, RATES = (1.0, 1.0 + 1e-9, 1.0 + 2e-9), (1.0, 2.0, 5.0)
DURATION, STEPS, SAMPLES = 100.0, 100_000, 200
METHOD, BASELINE = "rigid_splitting", "rk4"
BOUND = 2e-11
WHY = "round-off of 2e-16 in each of 100 000 steps, all of one sign"


def drifts(method: str, body: str, steps: int) -> np.ndarray:
    """Return the larger of the relative drifts of energy and momentum, shape (k,)."""
    inertia, omega = BODIES[body]
    y = run_fixed_steps(method, FreeBodyParameters(inertia), RigidBody(ATTITUDE, omega), DURATION, steps, SAMPLES)
    return drifts_of_run(y, inertia)


def drifts_of_run(y: np.ndarray, inertia: tuple[float, float, float]) -> np.ndarray:
    """Return the `drifts` of a run; `y` has R_world_body and omega_body at every sample, shape (k, 12)."""
    energy = (y[:, 9:12] ** 2 * inertia).sum(axis=1)
    return np.maximum(drift(energy), drift(to_world(y[:, :9], y[:, 9:12] * inertia)))


def angular_acceleration(inertia: tuple, omega: np.ndarray) -> np.ndarray:
    """Return omega' of Euler's equations [rad/s^2]."""
    return np.cross(np.multiply(inertia, omega), omega) / inertia


def nearly_spherical() -> tuple[float, float]:
    """Return the errors of the final rates [rad/s] of Lapwing's method and of the closed form in floats.

    The rates hardly change: their Taylor series of second order is exact to 1e-17.
    """
    o = np.array(RATES)
    first = angular_acceleration(SPHERICAL, o)
    second = angular_acceleration(SPHERICAL, o + 0.5 * first) - angular_acceleration(SPHERICAL, o - 0.5 * first)
    exact = o + DURATION * first + 0.5 * DURATION**2 * second
    start = RigidBody(ATTITUDE, RATES)
    ours = run_fixed_steps(METHOD, FreeBodyParameters(SPHERICAL), start, DURATION, STEPS, SAMPLES)[-1, 9:12]
    baseline = closed_form(SPHERICAL, start, DURATION)[9:12]
    return float(np.abs(ours - exact).max()), float(np.abs(baseline - exact).max())


def run() -> CaseResult:
    """Measure energy and momentum of two bodies, and the rates of the third."""
    t = np.linspace(0.0, DURATION, SAMPLES + 1)
    rows, curves = [], []
    for body in BODIES:
        ours, baseline = drifts(METHOD, body, STEPS), drifts(BASELINE, body, STEPS)
        rows.append(
            Row(body, f"{METHOD}, 1 ms", "change of energy and momentum, relative", BOUND, WHY, float(ours.max()),
                "RK4 on the components of the quaternion", float(baseline.max()))
        )  # fmt: skip
        curves += [Curve(f"{body}", t, ours), Curve(f"{body}, baseline", t, baseline)]
    off, baseline_off = nearly_spherical()
    rows.append(
        Row("nearly_spherical", f"{METHOD}, 1 ms", "error of the body rates [rad/s]", 1e-10,
            "as for `needle`, for 5 rad/s", off,
            "Jacobi's functions in textbook form, with cancellation of the moments", baseline_off)
    )  # fmt: skip
    return CaseResult(rows, Plot("time [s]", "change of energy and momentum", curves, BOUND))


def sweep() -> Sweep:
    """Increase the step for the needle."""
    counts = [1_000_000, 400_000, 200_000, 100_000, 50_000, 20_000, 10_000, 4000]
    curves = [
        Curve(name, DURATION / np.array(counts), np.array([drifts(name, "needle", n).max() for n in counts]))
        for name in (METHOD, "rkmk4", "implicit_lie_midpoint", "rk4_renormalised", "rk4", "lie_euler")
    ]
    return Sweep("step [s]", "change of energy and momentum of the needle", 1e-6, curves)
