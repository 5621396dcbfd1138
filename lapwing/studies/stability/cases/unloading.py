"""Case 19: final position of the unloaded pack at several steps."""

from functools import cache

import numpy as np

from lapwing.dynamics import integrators
from lapwing.services.plant.models import unloading
from lapwing.services.scene_resolver import load
from lapwing.studies.stability.case_result import CaseResult, Curve, Row, Sweep
from lapwing.studies.stability.flights import fly

HARD = "a pack pushed by rollers over an opening door: contacts that begin, slide, stick and end"

STEPS = (0.25e-3, 0.5e-3, 1e-3, 2e-3)  # [s]
BASELINE = 0.5e-3  # [s]
BOUND = 1e-5  # [m]
REMOVAL = 4.9  # [s] just before the removal of the pack


@cache
def end_position(step: float, *overrides: str) -> np.ndarray:
    """Return the position of the pack before its removal [m], shape (3,); NaN if the run ended early."""
    flight = fly("unload", [f"solver.step={step!r}", f"run.duration={REMOVAL!r}", *overrides])
    return np.full(3, np.nan) if flight.failure else flight.truth.position[-1]


def end_error(step: float) -> float:
    """Return the distance [m] from the final position at an accuracy of 1e-8."""
    return float(np.linalg.norm(end_position(step) - end_position(STEPS[0], "solver.accuracy=1e-8")))


def baseline_error(step: float) -> float:
    """Return the position error [m] of steps without error control; infinite if the run ends with an error."""
    p, start = unloading.system(load("unload"))
    try:
        _, rows = integrators.simulate(integrators.get("rk4_renormalised"), p, start, step, round(REMOVAL / step), 100)
    except ValueError:
        return np.inf
    return float(np.linalg.norm(rows[-1][:3] - end_position(STEPS[0], "solver.accuracy=1e-8")))


def run() -> CaseResult:
    """Compare the final positions at several steps."""
    row = Row("end", "RK4 with error control, steps of at most 0.25 to 2 ms",
              "distance [m] of the final position from that at an accuracy of 1e-8, worst of 4 steps", BOUND,
              "the tolerance of a substep", max(end_error(step) for step in STEPS),
              "RK4 at 0.5 ms without error control", baseline_error(BASELINE))  # fmt: skip
    return CaseResult([row], sweep().plot())


def sweep() -> Sweep:
    """Increase the step; without control the run ends with an error at 1 ms."""
    steps = np.array(STEPS)
    curves = [
        Curve("RK4 with error control", steps, np.array([end_error(float(step)) for step in steps])),
        Curve("RK4 without error control", steps, np.array([baseline_error(float(step)) for step in steps])),
    ]
    return Sweep("step [s]", "distance from the final position at an accuracy of 1e-8 [m]", BOUND, curves)
