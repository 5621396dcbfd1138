"""The estimate of the tick, and whether the commander has to look at it."""

from typing import NamedTuple

from lapwing.cosim.diagram.compiled_block import CONTINUE, WAKE_PYTHON, InputSample
from lapwing.kernels import always_inline
from lapwing.services.autopilot import estimator
from lapwing.services.autopilot.commander_wakeup import WakeupParameters, attention_due
from lapwing.services.autopilot.estimator import Estimator
from lapwing.services.autopilot.estimator.blocks.navigation_state import NavigationState
from lapwing.services.common.ports import StateEstimate


class FilterEstimate(NamedTuple):
    """The filter, and what calls the commander."""

    filter: Estimator
    attention: WakeupParameters
    before: StateEstimate  # the filter has begun


@always_inline
def step(
    p: FilterEstimate, s: NavigationState, tick: int, inputs: tuple[InputSample, ...]
) -> tuple[NavigationState, tuple[StateEstimate], int]:
    """What the filter says at `tick`."""
    battery, flight = inputs
    e = estimator.estimate(p.filter, s.filter) if s.begun else p.before
    due = attention_due(p.attention, tick, e.health, battery, flight)
    return s, (e,), WAKE_PYTHON if due else CONTINUE
