"""At which ticks the commander has a say: in between, an executor need not call it."""

from collections.abc import Mapping
from typing import NamedTuple

from dynamics.kernel import leaf
from services.autopilot.commander.view import POSITION_LOST


class BatteryThresholds(NamedTuple):
    """Charges, as fractions, below which the commander acts or warns."""

    low: float
    critical: float
    emergency: float


def battery_thresholds(parameters: Mapping[str, float]) -> BatteryThresholds:
    """The thresholds among the parameters' values."""
    return BatteryThresholds(parameters["BAT_LOW_THR"], parameters["BAT_CRIT_THR"], parameters["BAT_EMERGEN_THR"])


@leaf
def needs_attention(
    autonomous: bool,
    thresholds: BatteryThresholds,
    health: int,
    battery_charge: float,
    failed_motor: int,
    estimate_due: bool,
) -> bool:
    """Whether a commander whose last request was quiet must be called at this tick; it may be called at any.

    Args:
        autonomous: `Constants.autonomous`.
        thresholds: of the parameters as they are now; without an operator they never change.
        health: of the estimate.
        battery_charge: fraction; NaN: not known.
        failed_motor: its number, from 1; 0: none.
        estimate_due: whether the commander is shown a new estimate at this tick; without one, health does not matter.
    """
    battery_low = (
        battery_charge < thresholds.low or battery_charge < thresholds.critical or battery_charge < thresholds.emergency
    )
    position_lost = estimate_due and health & POSITION_LOST != 0
    return not autonomous or battery_low or failed_motor > 0 or position_lost
