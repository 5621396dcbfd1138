"""Conditions under which the commander must run."""

import math
from collections.abc import Mapping
from typing import NamedTuple

from lapwing.kernels import always_inline
from lapwing.services.autopilot.commander import failsafes
from lapwing.services.autopilot.commander.commander_input import POSITION_LOST
from lapwing.services.autopilot.commander.transitions import Context


class BatteryThresholds(NamedTuple):
    """Charges (fractions) below which the commander acts or warns."""

    low: float
    critical: float
    emergency: float


def battery_thresholds(parameters: Mapping[str, float]) -> BatteryThresholds:
    """Return the thresholds in the parameters' values."""
    return BatteryThresholds(parameters["BAT_LOW_THR"], parameters["BAT_CRIT_THR"], parameters["BAT_EMERGEN_THR"])


def time_without_changes(context: Context) -> float:
    """Return the time [s] after a tick for which the commander's output stays valid.

    It ends early if `needs_wakeup` is True, a command arrives or, with an operator, an estimate is due. It is 0 if
    the output may change at every tick.
    """
    state = context.state
    guidance = state.guidance
    timers_run = state.pending_arm is not None or bool(guidance.route.items)  # mission_state depends on flying
    distance_limited = any(guidance.home_distances)  # the vehicle may be outside at any tick
    if not state.on_trajectory or timers_run or distance_limited or failsafes.any_active(context):
        return 0.0
    inputs, parameters = guidance.inputs, guidance.parameters
    link_left = parameters["COM_DL_LOSS_T"] - inputs.link_age if inputs.linked else math.inf
    setpoints_left = parameters["COM_OF_LOSS_T"] - inputs.offboard_age if guidance.offboard_available else math.inf
    sticks_left = parameters.get("COM_RC_LOSS_T", math.inf) - inputs.sticks_age if guidance.sticks_fresh else math.inf
    return min(link_left, setpoints_left, sticks_left)


@always_inline
def needs_wakeup(
    thresholds: BatteryThresholds, health: int, battery_charge: float, failed_motor: int, estimate_due: bool
) -> bool:
    """Return True if the commander must run at this tick although its last output is still valid.

    Args:
        thresholds: present battery thresholds.
        health: of the estimate.
        battery_charge: fraction; NaN: unknown.
        failed_motor: its number, from 1; 0: none.
        estimate_due: the commander gets a new estimate at this tick; otherwise health is ignored.
    """
    battery_low = (
        battery_charge < thresholds.low or battery_charge < thresholds.critical or battery_charge < thresholds.emergency
    )
    position_lost = estimate_due and health & POSITION_LOST != 0
    return battery_low or failed_motor > 0 or position_lost
