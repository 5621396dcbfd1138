"""The battery's failure: off, it reports that it is empty, as PX4's does."""

from typing import Any, NamedTuple

from cosim.part import GO_ON, Received
from dynamics.kernel import leaf
from services.common.failures import OFF
from services.common.ports import BatteryGauge


class BatteryInjection(NamedTuple):
    """What is wrong."""

    faults: Any  # cell of `Faults`


@leaf
def step(p: BatteryInjection, s: Any, tick: int, inputs: tuple[Received, ...]) -> tuple[Any, tuple, int]:
    """What arrives of the gauge."""
    r = inputs[0].value
    x = BatteryGauge(0.0, r.voltage, r.current) if p.faults.value.battery == OFF else r
    return s, (x,), GO_ON
