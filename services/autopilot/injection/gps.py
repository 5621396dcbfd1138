"""The satellite receiver's failures; a wrong one is some 110 m off to the north."""

from typing import Any, NamedTuple

from cosim.part import GO_ON, Received
from dynamics.kernel import leaf
from services.autopilot.injection.memory import Memory, silent
from services.common.failures import STUCK, WRONG
from services.common.ports import GpsReading

NORTH = 1e-3  # [deg]


class GpsInjection(NamedTuple):
    """What is wrong."""

    faults: Any  # cell of `Faults`


@leaf
def step(p: GpsInjection, s: Memory, tick: int, inputs: tuple[Received, ...]) -> tuple[Memory, tuple, int]:
    """What arrives of the reading of the tick."""
    r, kind = inputs[0].value, p.faults.value.gps
    last = s.last if kind == STUCK else r
    x = last
    if kind == WRONG:
        x = GpsReading(
            r.latitude_deg + NORTH,
            r.longitude_deg,
            r.height,
            r.position_variance,
            r.velocity_world,
            r.velocity_variance,
            r.age,
            r.valid,
        )
    if silent(kind, s.readings):
        x = GpsReading(
            r.latitude_deg,
            r.longitude_deg,
            r.height,
            r.position_variance,
            r.velocity_world,
            r.velocity_variance,
            r.age,
            False,
        )
    return Memory(last, s.readings + 1), (x,), GO_ON
