"""The readings of the barometer."""

import math
from typing import NamedTuple

from cosim.part import GO_ON, Received
from dynamics.kernel import leaf
from services.autopilot import estimator
from services.autopilot.estimator import Estimator
from services.autopilot.navigation.state import NavigationState


class BarometerFusion(NamedTuple):
    """The filter."""

    filter: Estimator


@leaf
def step(
    p: BarometerFusion, s: NavigationState, tick: int, inputs: tuple[Received, ...]
) -> tuple[NavigationState, tuple[()], int]:
    """Correct by the reading of the tick."""
    r, x = inputs[0].value, s.filter
    if s.begun:
        x = estimator.update_barometer(p.filter, x, r.pressure if r.valid else math.nan, r.variance, r.valid)
    return NavigationState(s.begun, x), (), GO_ON
