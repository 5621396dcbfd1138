"""Failures of the battery monitor, as in PX4: off reports an empty pack, wrong a low charge."""

from typing import Any, NamedTuple

from lapwing.cosim.diagram.compiled_block import CONTINUE, InputSample
from lapwing.kernels import always_inline
from lapwing.services.common.failure_types import OFF, STUCK, WRONG
from lapwing.services.common.ports import BatteryReading


class BatteryInjection(NamedTuple):
    """Parameters of the block."""

    faults: Any  # cell of `Faults`


@always_inline
def step(
    p: BatteryInjection, s: BatteryReading, tick: int, inputs: tuple[InputSample, ...]
) -> tuple[BatteryReading, tuple, int]:
    """Output the received reading; the state is the last one before the monitor was stuck."""
    r, kind = inputs[0].value, p.faults.value.battery
    last = s if kind == STUCK else r
    x = last
    if kind == OFF:
        x = BatteryReading(0.0, r.voltage, r.current, r.temperature)
    elif kind == WRONG:
        x = BatteryReading(p.faults.value.battery_charge, r.voltage, r.current, r.temperature)
    return last, (x,), CONTINUE
