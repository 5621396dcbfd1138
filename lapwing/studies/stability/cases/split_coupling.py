"""Case 21: a carried load with its stiff control in a separate process."""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from lapwing.services.scene_resolver import load, resolve
from lapwing.studies.stability.case_result import CaseResult, Curve, Plot, Row, Sweep
from lapwing.studies.stability.flights import fly
from lapwing.studies.stability.sampled_runs import rows

HARD = "a carried load with its control in another process: inputs are constant during a communication step"

DURATION, SAMPLES = 5.0, 50  # [s]; samples at which runs are compared, at multiples of every interval
RATES = (400, 200, 100, 50, 40, 20, 10)  # [Hz]
STEP = 0.0025  # [s] of the plant
BOUND = 0.02  # [m]
LOW_RATE = 20  # [Hz]


@cache
def single_process(steps: int) -> np.ndarray:
    """Return the load's positions [m] with the control inside the plant's equations, shape (SAMPLES + 1, 3)."""
    services = resolve(load("cooperative_load", [])).services
    law: Any = services["formation"].parameters
    start: Any = services["plant"].parameters.start
    return rows("cf4", law.formation, start, DURATION, steps, SAMPLES)[:, :3]


@cache
def two_processes(rate: int, coupling: str) -> np.ndarray:
    """Return the load's positions [m] with plant and control in two processes, shape (SAMPLES + 1, 3).

    Args:
        rate: communication rate [Hz].
        coupling: "gauss_seidel" or "jacobi".

    Samples after the end of a run are NaN.
    """
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
    result = np.full((SAMPLES + 1, 3), np.nan)
    at = truth.position[:: round(DURATION / SAMPLES * rate)]
    result[: len(at)] = at
    return result


def distance_from_single(positions: np.ndarray) -> float:
    """Return the largest distance [m] from the single-process run over the finite samples."""
    distance = np.linalg.norm(positions - single_process(2000), axis=1)
    return float(np.nanmax(distance))


def run() -> CaseResult:
    """Compare one process with two."""
    one = float(np.linalg.norm(single_process(1000) - single_process(2000), axis=1).max())
    why = "the formation flies at 5 m/s, 12 mm per communication step of 2.5 ms"
    baseline = "two processes with Jacobi coupling at 20 Hz", distance_from_single(two_processes(LOW_RATE, "jacobi"))
    invariant, processes = "distance of the load [m] from the single-process run", "two processes at 400 Hz"
    figures = [
        Row(name, processes, invariant, BOUND, why, distance_from_single(two_processes(400, coupling)), *baseline)
        for name, coupling in (("sequential", "gauss_seidel"), ("parallel", "jacobi"))
    ]
    figures.append(
        Row("one", "control in the plant's equations, 5 ms", "distance of the load [m] from the run at 2.5 ms", 1e-4,
            "a hundredth of the error of the coupling", one, *baseline)
    )  # fmt: skip
    t = np.linspace(0.0, DURATION, SAMPLES + 1)
    curves = [
        Curve(f"{coupling}, {rate} Hz", t, np.linalg.norm(two_processes(rate, coupling) - single_process(2000), axis=1))
        for coupling in ("gauss_seidel", "jacobi")
        for rate in (400, 40, LOW_RATE)
    ]
    return CaseResult(figures, Plot("time [s]", "distance from the single-process run [m]", curves, BOUND))


def sweep() -> Sweep:
    """Decrease the communication rate."""
    intervals = 1.0 / np.array(RATES)

    def curve(name: str, positions: Callable[[int], np.ndarray], lowest: float = 0.0) -> Curve:
        """Return the distance of the runs at all `RATES`; NaN below the `lowest` [Hz]."""
        distances = [distance_from_single(positions(rate)) if rate >= lowest else np.nan for rate in RATES]
        return Curve(name, intervals, np.array(distances))

    curves = [
        curve("two processes, gauss_seidel", lambda rate: two_processes(rate, "gauss_seidel")),
        curve("two processes, jacobi", lambda rate: two_processes(rate, "jacobi")),
        curve("one process", lambda rate: single_process(round(DURATION * rate)), SAMPLES / DURATION),
    ]
    return Sweep("communication step, or integrator step [s]", "distance [m]", 1.0, curves)
