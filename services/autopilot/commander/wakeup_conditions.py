"""At which ticks the commander has a say: in between, an executor need not call it."""

import math
from collections.abc import Mapping
from typing import NamedTuple

from lapwing.kernels import always_inline
from lapwing.services.autopilot.commander import failsafes
from lapwing.services.autopilot.commander.commander_input import POSITION_LOST
from lapwing.services.autopilot.commander.transitions import Context


class BatteryThresholds(NamedTuple):
    """Charges, as fractions, below which the commander acts or warns."""

    low: float
    critical: float
    emergency: float


def battery_thresholds(parameters: Mapping[str, float]) -> BatteryThresholds:
    """The thresholds among the parameters' values."""
    return BatteryThresholds(parameters["BAT_LOW_THR"], parameters["BAT_CRIT_THR"], parameters["BAT_EMERGEN_THR"])


def quiet_time(context: Context) -> float:
    """Time [s] after a tick in which nothing changes what the commander asks for, unless one `needs_attention`, a
    command comes or, with an operator, a new estimate is shown; 0 where something may change at every tick."""
    state = context.state
    guidance = state.guidance
    counts = state.pending_arm is not None or bool(guidance.route.items)  # the state of a mission says if one flies
    if not state.on_trajectory or counts or failsafes.any_holds(context):
        return 0.0
    inputs, parameters = guidance.inputs, guidance.parameters
    link_left = parameters["COM_DL_LOSS_T"] - inputs.link_age if inputs.linked else math.inf
    setpoints_left = parameters["COM_OF_LOSS_T"] - inputs.offboard_age if guidance.offboard_fresh else math.inf
    return min(link_left, setpoints_left)


@always_inline
def needs_attention(
    thresholds: BatteryThresholds,
    health: int,
    battery_charge: float,
    failed_motor: int,
    estimate_due: bool,
) -> bool:
    """Whether a commander whose last request is still quiet must be called at this tick; it may be called at any.

    Args:
        thresholds: of the parameters as they are now.
        health: of the estimate.
        battery_charge: fraction; NaN: not known.
        failed_motor: its number, from 1; 0: none.
        estimate_due: whether the commander is shown a new estimate at this tick; without one, health does not matter.
    """
    battery_low = (
        battery_charge < thresholds.low or battery_charge < thresholds.critical or battery_charge < thresholds.emergency
    )
    position_lost = estimate_due and health & POSITION_LOST != 0
    return battery_low or failed_motor > 0 or position_lost
