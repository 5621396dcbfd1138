"""Case 19: where the unloaded pack comes to lie, under finer and finer steps."""

from functools import cache

import numpy as np

from studies.stability.case import Curve, Found, Row, Sweep
from studies.stability.flights import flown

HARD = "a pack that rollers push over a door that falls open: contacts that begin, slide, stick and end"

FINEST = 2.0**-6 * 1e-3  # [s]
FINE = tuple(2.0**-k * 1e-3 for k in (2, 3, 4, 5))
COARSE = 0.5e-3
BOUND = 5e-3  # [m]


@cache
def end(step: float) -> np.ndarray:
    """Where the pack lies just before somebody takes it away [m], NaN where the run ended before that; shape (3,)."""
    flight = flown("unload", [f"solver.step={step!r}", "run.duration=4.9"])
    return np.full(3, np.nan) if flight.failure else flight.truth.position[-1]


def off(step: float) -> float:
    """Distance [m] from where it lies at the finest step."""
    return float(np.linalg.norm(end(step) - end(FINEST)))


def run() -> Found:
    """The end at every step from a quarter of a millisecond down."""
    row = Row(
        "end",
        "RK4 at 0.25 ms and finer, as the scene has it",
        "distance [m] of the pack's end from that at 16 us, worst of 4 steps",
        BOUND,
        "a fortieth of the pack's length; where contacts begin within a step is not resolved further",
        max(off(step) for step in FINE),
        "the plant's usual halved, 0.5 ms",
        off(COARSE),
    )
    return Found([row], sweep().plot())


def sweep() -> Sweep:
    """Longer and longer steps; at 1 ms the run ends with an error that says so."""
    steps = np.array([*FINE[::-1], COARSE, 1e-3])
    curves = [Curve("RK4", steps, np.array([off(float(step)) for step in steps]))]
    return Sweep("step [s]", "distance from the end at 16 us [m]", BOUND, curves)
