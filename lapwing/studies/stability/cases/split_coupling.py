"""Case 21: a load with stiff control in a separate process."""

from functools import cache
from typing import Any

import numpy as np

from lapwing.services.scene_resolver import load, resolve
from lapwing.studies.stability.case_result import CaseResult, Curve, Plot, Row, Sweep
from lapwing.studies.stability.flights import fly
from lapwing.studies.stability.sampled_runs import rows

HARD = "a carried load whose control is another process: each is constant for the other during a step"

DURATION, LOOKS = 5.0, 50  # [s], times at which runs are compared: a multiple of every interval
RATES = (400, 200, 100, 50, 40, 20, 10)  # [Hz]
STEP = 0.0025  # [s] of the plant
ALLOWED = 0.02  # [m]
SLOW = 20  # [Hz]


@cache
def together(steps: int) -> np.ndarray:
    """Return the load's positions [m] with the control inside the plant's equations, shape (LOOKS + 1, 3)."""
    services = resolve(load("cooperative_load", [])).services
    law: Any = services["formation"].parameters
    start: Any = services["plant"].parameters.start
    return rows("cf4", law.formation, start, DURATION, steps, LOOKS)[:, :3]


@cache
def apart(rate: int, coupling: str) -> np.ndarray:
    """Return the positions with plant and control in two processes that exchange at a rate [Hz]; NaN after the end."""
    slow = [f"rates.{name}=10" for name in ("pose", "estimate", "status", "battery", "commands")]
    interval = 1.0 / rate
    solver = f"solver.step={interval / round(interval / STEP)!r}"
    truth = fly(
        "cooperative_load",
        [
            f"communication.rate={rate}",
            f"rates.body_states={rate}",
            f"communication.coupling={coupling}",
            solver,
            *slow,
        ],
    ).truth
    result = np.full((LOOKS + 1, 3), np.nan)
    at = truth.position[:: round(DURATION / LOOKS * rate)]
    result[: len(at)] = at
    return result


def off(positions: np.ndarray) -> float:
    """Return the maximum distance [m] from the single-process run, over the finite samples."""
    distance = np.linalg.norm(positions - together(2000), axis=1)
    return float(np.nanmax(distance))


def run() -> CaseResult:
    """Compare one process with two."""
    one = float(np.linalg.norm(together(1000) - together(2000), axis=1).max())
    why = "the formation flies at 5 m/s: in an exchange of 2.5 ms it moves by 12 mm"
    broken, drowned = off(apart(SLOW, "jacobi")), "two processes in parallel (Jacobi) at 20 Hz"
    what, exchanging = "load's distance [m] from the same in one", "two processes at 400 Hz"
    near, far = off(apart(400, "gauss_seidel")), off(apart(400, "jacobi"))
    how = "control inside of the plant's equations, 5 ms"
    cost = "a hundredth of what the exchange costs is what the step may"
    figures = [
        Row("sequential", exchanging, what, ALLOWED, why, near, drowned, broken),
        Row("parallel", exchanging, what, ALLOWED, why, far, drowned, broken),
        Row("one", how, "load's distance [m] from that at 2.5 ms", 1e-4, cost, one, drowned, broken),
    ]
    t = np.linspace(0.0, DURATION, LOOKS + 1)
    curves = [
        Curve(f"{coupling}, {rate} Hz", t, np.linalg.norm(apart(rate, coupling) - together(2000), axis=1))
        for coupling in ("gauss_seidel", "jacobi")
        for rate in (400, 40, SLOW)
    ]
    return CaseResult(figures, Plot("time [s]", "distance from the run in one process [m]", curves, ALLOWED))


def sweep() -> Sweep:
    """Decrease the communication rate."""
    intervals = 1.0 / np.array(RATES)
    curves = [
        Curve(f"two processes, {coupling}", intervals, np.array([off(apart(rate, coupling)) for rate in RATES]))
        for coupling in ("gauss_seidel", "jacobi")
    ]
    one = np.array([off(together(round(DURATION * rate))) if rate >= LOOKS / DURATION else np.nan for rate in RATES])
    return Sweep("exchange interval, or step [s]", "distance [m]", 1.0, [*curves, Curve("one process", intervals, one)])
