"""Sliding touchdowns of the delivery drone: level at 0.4 m/s forward, and tilted on a slope."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from lapwing.dynamics import integrators
from lapwing.dynamics.vehicles import multirotor
from lapwing.dynamics.vehicles.multirotor_equations import with_tolerance
from lapwing.kernels.state_tree import flatten
from lapwing.services.plant.schema import contact_tolerance
from lapwing.studies.accuracy.coordinates import coordinates, defect
from lapwing.studies.accuracy.integrate import SAMPLES
from lapwing.studies.accuracy.landings import cases
from lapwing.studies.accuracy.landings.cases import Landing
from lapwing.studies.accuracy.problem import Problem, SolverMethod, SolverRun

METHODS = ("rk4_renormalised", "rkmk4", "rk8_renormalised")
STEP = 1e-3  # [s] longest step
EVENTS = "SciPy DOP853 at 1e-13, located events of every foot, independent equations"
TOUCH_DOWNS = {
    "landing_level": Landing((0.0, 0.0), 0.0, 0.1, (0.4, 0.0), (0.0, 0.0, 0.0), 0.0, (0.0, 0.0, 0.0), 0.0),
    "landing_slope": Landing(
        (math.tan(math.radians(15.0)), 0.1), 0.0, 1.0, (0.8, -0.3), (0.2, -0.1, 0.0), 0.5, (0.3, -0.2, 0.4), 200.0
    ),
}
TITLES = {
    "landing_level": "delivery drone touching down on level ground, sliding",
    "landing_slope": "delivery drone touching down on a slope, leaning, spinning and sliding",
}


def problems() -> dict[str, Problem]:
    """Return the problems of this file: two touchdowns with `solver.accuracy` as setting."""
    return {name: _problem(TITLES[name], case) for name, case in TOUCH_DOWNS.items()}


def _problem(title: str, case: Landing) -> Problem:
    methods = [_solver_method(name, case) for name in METHODS]
    return Problem(title, cases.DURATION, methods, lambda: cases.exact(case)[0][-1], EVENTS)


def _solver_method(name: str, case: Landing) -> SolverMethod:
    method = integrators.get(name)
    ticks = round(cases.DURATION / cases.INTERVAL)

    def prepare(accuracy: float, rows: int = SAMPLES + 1) -> Callable[[], Any]:
        p, start = cases.plant(case)
        p, off = with_tolerance(p, contact_tolerance(accuracy)), (0.0,) * len(p.layout.x_body)
        steps = round(cases.INTERVAL / STEP)

        def fly() -> tuple[np.ndarray, np.ndarray]:
            state, motions, at = start, [start.motion], [0]
            for row in range(1, rows):
                at.append(round(row * ticks / SAMPLES))
                for tick in range(at[-2], at[-1]):
                    state = multirotor.advance(method.Method(), p, (0, 0), tick, state, off, STEP, steps)
                motions.append(state.motion)
            return np.array(at) * cases.INTERVAL, np.array([flatten(m) for m in motions])

        return fly

    def read(_: float, result: tuple[np.ndarray, np.ndarray]) -> SolverRun | None:
        times, rows = result
        motion = cases.plant(case)[1].motion
        return SolverRun(times, coordinates(motion, rows), defect(motion, rows[-1]), None)

    return SolverMethod(name, method.ORDER, "tol", cases.ACCURACIES, prepare, read, prepare(1.0, rows=1))
