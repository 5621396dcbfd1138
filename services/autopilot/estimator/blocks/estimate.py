"""Output of the estimate and wake-up of the commander."""

from typing import NamedTuple

from lapwing.cosim.diagram.compiled_block import CONTINUE, WAKE_PYTHON, InputSample
from lapwing.kernels import always_inline
from lapwing.services.autopilot import estimator
from lapwing.services.autopilot.commander_wakeup import WakeupParameters, wakeup_due
from lapwing.services.autopilot.estimator import Estimator
from lapwing.services.autopilot.estimator.blocks.navigation_state import NavigationState
from lapwing.services.common.ports import StateEstimate


class FilterEstimate(NamedTuple):
    """Parameters of the block."""

    filter: Estimator
    wakeup: WakeupParameters
    before: StateEstimate  # output until the filter has started


@always_inline
def step(
    p: FilterEstimate, s: NavigationState, tick: int, inputs: tuple[InputSample, ...]
) -> tuple[NavigationState, tuple[StateEstimate], int]:
    """Output the estimate at `tick`."""
    battery, flight = inputs
    e = estimator.estimate(p.filter, s.filter) if s.started else p.before
    due = wakeup_due(p.wakeup, tick, e.health, battery, flight)
    return s, (e,), WAKE_PYTHON if due else CONTINUE
