"""Fusion of the sonar as height reference: the estimated height is above the ground."""

import math
from typing import NamedTuple

from lapwing.cosim.diagram.compiled_block import CONTINUE, InputSample
from lapwing.kernels import always_inline
from lapwing.services.autopilot import estimator
from lapwing.services.autopilot.estimator import Estimator
from lapwing.services.autopilot.estimator.blocks.navigation_state import NavigationState


class GroundReference(NamedTuple):
    """Parameters of the block; the filter accepts the sonar at any height."""

    filter: Estimator


@always_inline
def step(
    p: GroundReference, s: NavigationState, tick: int, inputs: tuple[InputSample, ...]
) -> tuple[NavigationState, tuple[()], int]:
    """Correct the filter by the reading of the tick."""
    r, x = inputs[0].value, s.filter
    if s.started:
        if r.valid and not math.isinf(r.range):
            estimator.follow_ground(p.filter, x)
        x = estimator.update_sonar(p.filter, x, r.range, r.variance, r.valid)
    return NavigationState(s.started, x), (), CONTINUE
