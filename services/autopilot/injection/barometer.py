"""The barometer's failures; a wrong one reads some 40 m too low."""

from typing import Any, NamedTuple

from cosim.part import GO_ON, Received
from dynamics.kernel import leaf
from services.autopilot.injection.memory import Memory, silent
from services.common.failures import STUCK, WRONG
from services.common.ports import BarometerReading

EXCESS = 500.0  # [Pa]


class BarometerInjection(NamedTuple):
    """What is wrong."""

    faults: Any  # cell of `Faults`


@leaf
def step(p: BarometerInjection, s: Memory, tick: int, inputs: tuple[Received, ...]) -> tuple[Memory, tuple, int]:
    """What arrives of the reading of the tick."""
    r, kind = inputs[0].value, p.faults.value.barometer
    last = s.last if kind == STUCK else r
    x = last
    if kind == WRONG:
        x = BarometerReading(r.pressure + EXCESS, r.variance, r.valid)
    if silent(kind, s.readings):
        x = BarometerReading(r.pressure, r.variance, False)
    return Memory(last, s.readings + 1), (x,), GO_ON
