"""The readings of the sonar where it is the reference of the height, which then is that above the ground."""

import math
from typing import NamedTuple

from lapwing.cosim.diagram.compiled_block import CONTINUE, InputSample
from lapwing.kernels import always_inline
from lapwing.services.autopilot import estimator
from lapwing.services.autopilot.estimator import Estimator
from lapwing.services.autopilot.estimator.blocks.navigation_state import NavigationState


class GroundReference(NamedTuple):
    """The filter; it takes the sonar at any height."""

    filter: Estimator


@always_inline
def step(
    p: GroundReference, s: NavigationState, tick: int, inputs: tuple[InputSample, ...]
) -> tuple[NavigationState, tuple[()], int]:
    """Correct by the reading of the tick."""
    r, x = inputs[0].value, s.filter
    if s.begun:
        if r.valid and not math.isinf(r.range):
            estimator.follow_ground(p.filter, x)
        x = estimator.update_sonar(p.filter, x, r.range, r.variance, r.valid)
    return NavigationState(s.begun, x), (), CONTINUE
