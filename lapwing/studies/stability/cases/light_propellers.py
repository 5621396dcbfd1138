"""Case 8: propellers with a thousandth of their inertia, at 1000 rad/s."""

import numpy as np

from lapwing.studies.stability.case_result import CaseResult, Curve, Plot, Row, Sweep
from lapwing.studies.stability.drone import PAPER, STABILISATIONS, delivery_drone, hinge_defects, spinning_state

HARD = "propellers with a thousandth of their inertia at 1000 rad/s: inertia ratio of 10 to 1e-8, 0.25 rad per step"

SCALE, SPEED, STEP, SAMPLES, STEPS_PER_SAMPLE = 1e-3, 1000.0, 2.5e-4, 40, 200
OMEGA = (1.0, -0.7, 0.4)
BOUND = 1e-9
WHY = "round-off of a propeller's rate, 1e-13, times the number of steps"


def defects(method: int, scale: float, speed: float, step: float, samples: int) -> np.ndarray:
    """Return the largest position or velocity defect after every `STEPS_PER_SAMPLE` steps, shape (samples,)."""
    inertia = tuple(scale * i for i in PAPER["propeller_inertia"])
    drone = delivery_drone(**{**PAPER, "propeller_inertia": inertia}, driven="speed")
    p, x = spinning_state(drone, OMEGA, (speed, -speed) * 2)
    return hinge_defects(p, x, method, step, STEPS_PER_SAMPLE, samples)


def run() -> CaseResult:
    """Measure the hinge defects over two seconds."""
    drift = {name: defects(method, SCALE, SPEED, STEP, SAMPLES) for name, method in STABILISATIONS.items()}
    rows = [
        Row(name, f"{name}, RK4 at 0.25 ms", "largest defect of any hinge in 2 s [m, rad, m/s, rad/s]", BOUND, WHY,
            float(drift[name].max()), "no stabilisation", float(np.nanmax(drift["none"])))
        for name in ("projection", "partitioning")
    ]  # fmt: skip
    t = STEPS_PER_SAMPLE * STEP * np.arange(1, SAMPLES + 1)
    curves = [Curve(name, t, np.maximum(values, 1e-17)) for name, values in drift.items()]
    return CaseResult(rows, Plot("time [s]", "largest defect", curves, BOUND))


def sweep() -> Sweep:
    """Increase the propeller speed at the same step."""
    speeds = np.geomspace(100.0, 2e4, 12)
    curves = [
        Curve(name, speeds, np.array([defects(method, SCALE, float(s), STEP, 10)[-1] for s in speeds]))
        for name, method in STABILISATIONS.items()
    ]
    return Sweep("speed of the propellers [rad/s] at a step of 0.25 ms", "largest defect after 0.5 s", 1e-6, curves)
