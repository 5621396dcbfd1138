"""The readings of the magnetometer."""

import math
from typing import NamedTuple

from cosim.part import GO_ON, Received
from dynamics.kernel import leaf
from services.autopilot import estimator
from services.autopilot.estimator import Estimator
from services.autopilot.navigation.state import NavigationState


class MagnetometerFusion(NamedTuple):
    """The filter."""

    filter: Estimator


@leaf
def step(
    p: MagnetometerFusion, s: NavigationState, tick: int, inputs: tuple[Received, ...]
) -> tuple[NavigationState, tuple[()], int]:
    """Correct by the reading of the tick."""
    r, x = inputs[0].value, s.filter
    if s.begun:
        nothing = (math.nan, math.nan, math.nan)
        field = r.field_body if r.valid else nothing
        x = estimator.update_magnetometer(p.filter, x, field, r.variance, r.valid)
    return NavigationState(s.begun, x), (), GO_ON
