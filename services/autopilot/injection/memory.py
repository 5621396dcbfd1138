"""What an injected failure remembers, and when a slow sensor still speaks."""

from typing import Any, NamedTuple

from dynamics.kernel import leaf
from services.common.failures import OFF, SLOW

SLOWED = 20  # readings of which a slow sensor gives one


class Memory(NamedTuple):
    """Of one sensor."""

    last: Any  # the newest reading that got through before it stuck
    readings: int  # so far


@leaf
def silent(kind: int, count: int) -> bool:
    """Whether this reading does not arrive."""
    return kind == OFF or (kind == SLOW and count % SLOWED != 0)
