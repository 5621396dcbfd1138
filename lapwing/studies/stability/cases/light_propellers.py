"""Case 8: propellers a thousand times too light, at 1000 rad/s."""

from typing import Any

import numpy as np

from lapwing.dynamics import integrators
from lapwing.dynamics.multibody.five_body_stabilisation import (
    NONE,
    PARTITION,
    PROJECTION,
    advance,
    constraint_violation,
)
from lapwing.studies.stability.case_result import CaseResult, Curve, Plot, Row, Sweep
from lapwing.studies.stability.drone import PAPER, delivery_drone, spinning_state

HARD = "propellers with a thousandth of their inertia at 1000 rad/s: a mass ratio of 10 to 1e-8, and 0.25 rad a step"

METHOD = integrators.get("rk4_renormalised").Method()
SCALE, SPEED, STEP, LOOKS, EACH = 1e-3, 1000.0, 2.5e-4, 40, 200
OMEGA = (1.0, -0.7, 0.4)
BOUND = 1e-9
WHY = "round-off of a propeller's rate, 1e-13, times the number of steps in which it can add up"
WAYS = {"projection": PROJECTION, "partitioning": PARTITION, "none": NONE}


def defects(way: int, scale: float, speed: float, step: float, looks: int) -> np.ndarray:
    """Return the largest defect on either level after every EACH steps, shape (looks,)."""
    inertia = tuple(scale * i for i in PAPER["propeller_inertia"])
    p: Any
    p, x = spinning_state(
        delivery_drone(**{**PAPER, "propeller_inertia": inertia}, driven="speed"), OMEGA, (speed, -speed) * 2
    )
    result = []
    for look in range(looks):
        x = advance(METHOD, p, look * EACH * step, x, step, EACH, way)
        result.append(max(constraint_violation(p, x)))
    return np.array(result)


def run() -> CaseResult:
    """Measure the hinge defects over two seconds."""
    drift = {name: defects(way, SCALE, SPEED, STEP, LOOKS) for name, way in WAYS.items()}
    rows = [
        Row(
            name,
            f"{name}, RK4 at 0.25 ms",
            "largest defect of any hinge in 2 s [m, rad, m/s, rad/s]",
            BOUND,
            WHY,
            float(drift[name].max()),
            "no stabilisation",
            float(np.nanmax(drift["none"])),
        )
        for name in ("projection", "partitioning")
    ]
    t = EACH * STEP * np.arange(1, LOOKS + 1)
    curves = [Curve(name, t, np.maximum(values, 1e-17)) for name, values in drift.items()]
    return CaseResult(rows, Plot("time [s]", "largest defect", curves, BOUND))


def sweep() -> Sweep:
    """Increase the propeller speed at the same step."""
    speeds = np.geomspace(100.0, 2e4, 12)
    curves = [
        Curve(name, speeds, np.array([defects(way, SCALE, float(s), STEP, 10)[-1] for s in speeds]))
        for name, way in WAYS.items()
    ]
    return Sweep("speed of the propellers [rad/s] at a step of 0.25 ms", "largest defect after 0.5 s", 1e-6, curves)
