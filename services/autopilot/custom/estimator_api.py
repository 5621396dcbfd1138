"""Interface of user-defined estimators; user code imports its names from `lapwing.plugins`.

In a scene:

    [autopilot]
    estimator = "my_module:MyEstimator"
    [autopilot.estimator_options]
    cutoff = 2.0

In `my_module.py`, next to the scene or on Python's path:

    class MyEstimator:
        rate = 250.0                                              # [Hz], divides the communication rate

        def __init__(self, vehicle: VehicleModel, cutoff: float = 1.0): ...

        def step(self, time: float, readings: Mapping[str, Any]) -> StateEstimate: ...

The estimator is constructed once. Its `step` is called at its rate from tick 0; its last estimate holds in between.
`readings` maps the sensor's name ("imu", "gps") to the newest reading since the last step and omits sensors without a
new one; their types are in `lapwing.plugins`. The vehicle starts at the origin, at
`vehicle.resting_height`.
"""

import math
from typing import Any

from lapwing.kernels.row_packing import pack_row, row_width
from lapwing.services.common.controller_api import VehicleModel
from lapwing.services.common.ports import StateEstimate

__all__ = ["StateEstimate", "VehicleModel", "validate_estimate"]

WIDTH = row_width(StateEstimate())


def validate_estimate(result: Any) -> StateEstimate:
    """Return the estimate that a step returned, with tuples for arrays and lists.

    Raises:
        TypeError: the result is not a `StateEstimate` or has the wrong shape.
        ValueError: a number is not finite.
    """
    if not isinstance(result, StateEstimate):
        raise TypeError(f"step returned {type(result).__name__}, expected StateEstimate")
    estimate = StateEstimate(*(tuple(map(float, v)) if hasattr(v, "__len__") else v for v in result))  # type: ignore[arg-type]
    row = pack_row(estimate)
    if len(row) != WIDTH:
        raise TypeError(f"step returned an estimate of {len(row)} numbers, expected {WIDTH}")
    if not all(map(math.isfinite, row)):
        raise ValueError("step returned an estimate that is not finite")
    return estimate
