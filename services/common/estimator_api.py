"""What an estimator of one's own is given, and what it returns.

In a scene:

    [autopilot]
    estimator = "my_module:MyEstimator"
    [autopilot.estimator_options]
    cutoff = 2.0

In `my_module.py`, beside the scene or on Python's path:

    class MyEstimator:
        rate = 250.0                                              # [Hz], divides the exchange rate

        def __init__(self, vehicle: VehicleModel, cutoff: float = 1.0): ...

        def step(self, time: float, readings: Mapping[str, Any]) -> StateEstimate: ...

It is constructed once, and asked at its rate from tick 0 on; in between, its estimate holds. `readings` has, by the
sensor's name ("imu", "gps"), the newest reading that has come since the last step, and nothing of a sensor that has
given none; the types are those of `lapwing.services.common.ports`. The vehicle stands at the origin at first, at
`vehicle.resting_height`.
"""

import math
from typing import Any

from lapwing.kernels.row_packing import pack_row, row_width
from lapwing.services.common.controller_api import VehicleModel
from lapwing.services.common.ports import StateEstimate

__all__ = ["StateEstimate", "VehicleModel", "checked_estimate"]

WIDTH = row_width(StateEstimate())


def checked_estimate(found: Any) -> StateEstimate:
    """What a step has returned, with tuples for arrays and lists.

    Raises:
        TypeError: no estimate, or one of another shape.
        ValueError: a number is not finite.
    """
    if not isinstance(found, StateEstimate):
        raise TypeError(f"step returned {type(found).__name__}, expected StateEstimate")
    made = StateEstimate(*(tuple(map(float, v)) if hasattr(v, "__len__") else v for v in found))  # type: ignore[arg-type]
    row = pack_row(made)
    if len(row) != WIDTH:
        raise TypeError(f"step returned an estimate of {len(row)} numbers, expected {WIDTH}")
    if not all(map(math.isfinite, row)):
        raise ValueError("an estimate that is not finite")
    return made
