"""What an injected failure remembers, and when a sensor that is slow or works now and then still speaks."""

from typing import Any, NamedTuple

from lapwing.dynamics.noise import Key, uniform, uniform4
from lapwing.dynamics.vector import Vec3
from lapwing.kernels import always_inline
from lapwing.services.common.failure_types import INTERMITTENT, OFF, SLOW

SLOWED = 20  # readings of which a slow sensor gives one
BURST = 5  # readings that an intermittent sensor gives or drops together
DELAY = 0.5  # [s] by which the readings of a delayed one come too late


class Memory(NamedTuple):
    """Of one sensor."""

    last: Any  # the newest reading that got through before it stuck
    readings: int  # so far


@always_inline
def silent(kind: int, key: Key, lane: int, count: int) -> bool:
    """Whether this reading does not arrive; `lane` tells two instruments of one reading apart."""
    if kind == INTERMITTENT:
        return uniform(key, count // BURST, lane) < 0.5
    return kind == OFF or (kind == SLOW and count % SLOWED != 0)


@always_inline
def garbage(key: Key, tick: int, lane: int, reach: float) -> Vec3:
    """Three numbers within +-reach that mean nothing."""
    a, b, c, _ = uniform4(key, tick, lane)
    return reach * (2.0 * a - 1.0), reach * (2.0 * b - 1.0), reach * (2.0 * c - 1.0)
