"""Case 19: where the unloaded pack comes to lie, under longer and longer steps."""

from functools import cache

import numpy as np

from lapwing.dynamics import integrators
from lapwing.services.plant.models import unloading
from lapwing.services.scene_resolver import load
from lapwing.studies.stability.case_result import CaseResult, Curve, Row, Sweep
from lapwing.studies.stability.flights import fly

HARD = "a pack that rollers push over a door that falls open: contacts that begin, slide, stick and end"

STEPS = (0.25e-3, 0.5e-3, 1e-3, 2e-3)  # [s]
BASELINE = 0.5e-3  # [s]
BOUND = 1e-5  # [m]
TAKEN = 4.9  # [s] just before it is taken away


@cache
def end(step: float, *more: str) -> np.ndarray:
    """Return the pack's position before removal [m], NaN if the run ended before; shape (3,)."""
    flight = fly("unload", [f"solver.step={step!r}", f"run.duration={TAKEN!r}", *more])
    return np.full(3, np.nan) if flight.failure else flight.truth.position[-1]


def off(step: float) -> float:
    """Return the distance [m] from the final position at an accuracy of 1e-8."""
    return float(np.linalg.norm(end(step) - end(STEPS[0], "solver.accuracy=1e-8")))


def baseline(step: float) -> float:
    """Return the position error of steps without error control; infinite if the run ends with an error."""
    p, start = unloading.system(load("unload"))
    try:
        _, rows = integrators.simulate(integrators.get("rk4_renormalised"), p, start, step, round(TAKEN / step), 100)
    except ValueError:
        return np.inf
    return float(np.linalg.norm(rows[-1][:3] - end(STEPS[0], "solver.accuracy=1e-8")))


def run() -> CaseResult:
    """Compare the end at every step."""
    row = Row(
        "end",
        "RK4 with its error controlled, steps of 0.25 to 2 ms at most",
        "distance [m] of the pack's end from that at an accuracy of 1e-8, worst of 4 steps",
        BOUND,
        "the tolerance of a part of a step",
        max(off(step) for step in STEPS),
        "RK4 at 0.5 ms as it is",
        baseline(BASELINE),
    )
    return CaseResult([row], sweep().plot())


def sweep() -> Sweep:
    """Increase the step; without control the run ends with an error at 1 ms."""
    steps = np.array(STEPS)
    curves = [
        Curve("RK4, error controlled", steps, np.array([off(float(step)) for step in steps])),
        Curve("RK4 as it is", steps, np.array([baseline(float(step)) for step in steps])),
    ]
    return Sweep("step [s]", "distance from the end at an accuracy of 1e-8 [m]", BOUND, curves)
