"""State of injected failures and timing of slow and intermittent sensors."""

from typing import Any, NamedTuple

from lapwing.dynamics.noise import Key, uniform, uniform4
from lapwing.dynamics.vector import Vec3
from lapwing.kernels import always_inline
from lapwing.services.common.failure_types import INTERMITTENT, OFF, SLOW

SLOWED = 20  # readings per output of a slow sensor
BURST = 5  # consecutive readings that an intermittent sensor outputs or drops
DELAY = 0.5  # [s] of a delayed sensor


class Memory(NamedTuple):
    """State of one sensor."""

    last: Any  # last reading before the sensor was stuck
    readings: int  # number of readings


@always_inline
def is_dropped(kind: int, key: Key, lane: int, count: int) -> bool:
    """Return True if this reading is dropped; `lane` distinguishes two instruments in one reading."""
    if kind == INTERMITTENT:
        return uniform(key, count // BURST, lane) < 0.5
    return kind == OFF or (kind == SLOW and count % SLOWED != 0)


@always_inline
def garbage(key: Key, tick: int, lane: int, reach: float) -> Vec3:
    """Return three random numbers within +-reach."""
    a, b, c, _ = uniform4(key, tick, lane)
    return reach * (2.0 * a - 1.0), reach * (2.0 * b - 1.0), reach * (2.0 * c - 1.0)
