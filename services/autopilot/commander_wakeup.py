"""Compiled checks that wake the commander."""

from typing import Any, NamedTuple

from lapwing.cosim.diagram.compiled_block import InputSample
from lapwing.kernels import always_inline
from lapwing.services.autopilot.commander.wakeup_conditions import BatteryThresholds, needs_wakeup

ESTIMATE_POLL_TICKS = 5  # [ticks] between two estimates passed to the commander


class WakeupParameters(NamedTuple):
    """Parameters of the checks."""

    thresholds: Any  # cell of `BatteryThresholds`


@always_inline
def wakeup_due(p: WakeupParameters, tick: int, health: int, battery: InputSample, flight: InputSample) -> bool:
    """Return True if the commander must run at `tick`."""
    charge = battery.value.charge if battery.due else 1.0
    failed = flight.value.failed_motor if flight.due else 0
    return needs_wakeup(p.thresholds.value, health, charge, failed, tick % ESTIMATE_POLL_TICKS == 0)


@always_inline
def battery_warning(thresholds: BatteryThresholds, charge: float) -> int:
    """Return 0 for none, 1 low, 2 critical, 3 nearly empty; 0 for an unknown charge (NaN)."""
    return int(charge < thresholds.low) + int(charge < thresholds.critical) + int(charge < thresholds.emergency)
