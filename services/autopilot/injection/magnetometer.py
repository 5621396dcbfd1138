"""The magnetometer's failures; a wrong one is turned by 90 degrees."""

from typing import Any, NamedTuple

from cosim.part import GO_ON, Received
from dynamics.kernel import leaf
from services.autopilot.injection.memory import Memory, silent
from services.common.failures import STUCK, WRONG
from services.common.ports import MagnetometerReading


class MagnetometerInjection(NamedTuple):
    """What is wrong."""

    faults: Any  # cell of `Faults`


@leaf
def step(p: MagnetometerInjection, s: Memory, tick: int, inputs: tuple[Received, ...]) -> tuple[Memory, tuple, int]:
    """What arrives of the reading of the tick."""
    r, kind = inputs[0].value, p.faults.value.magnetometer
    last = s.last if kind == STUCK else r
    x = last
    if kind == WRONG:
        x = MagnetometerReading((-r.field_body[1], r.field_body[0], r.field_body[2]), r.variance, r.valid)
    if silent(kind, s.readings):
        x = MagnetometerReading(r.field_body, r.variance, False)
    return Memory(last, s.readings + 1), (x,), GO_ON
