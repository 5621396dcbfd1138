"""What calls the commander, as the compiled parts before it look at it."""

from typing import Any, NamedTuple

from lapwing.cosim.diagram.compiled_block import InputSample
from lapwing.kernels import always_inline
from lapwing.services.autopilot.commander.wakeup_conditions import BatteryThresholds, needs_attention

ESTIMATE_POLL_TICKS = 5  # ticks between two looks of the commander at the estimate


class WakeupParameters(NamedTuple):
    """What the conditions depend on."""

    thresholds: Any  # cell of `BatteryThresholds`, which an operator may change


@always_inline
def attention_due(p: WakeupParameters, tick: int, health: int, battery: InputSample, flight: InputSample) -> bool:
    """Whether the commander has a say at `tick`; battery and flight as they were received."""
    charge = battery.value.charge if battery.due else 1.0
    failed = flight.value.failed_motor if flight.due else 0
    return needs_attention(p.thresholds.value, health, charge, failed, tick % ESTIMATE_POLL_TICKS == 0)


@always_inline
def battery_warning(thresholds: BatteryThresholds, charge: float) -> int:
    """0: none, 1: low, 2: critical, 3: nearly empty; an unknown charge (NaN) is none."""
    return int(charge < thresholds.low) + int(charge < thresholds.critical) + int(charge < thresholds.emergency)
