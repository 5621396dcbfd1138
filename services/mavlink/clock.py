"""Clocks of a link: simulation time of the vehicle, and wall time of its endpoints."""

from typing import NamedTuple


class Instant(NamedTuple):
    """Instant on both clocks."""

    time_ns: int = 0  # [ns] simulation time
    wall: float = 0.0  # [s] monotonic


class Clock:
    """Current instant, and the time since earlier ones."""

    def __init__(self) -> None:
        self.now = Instant()

    def since(self, earlier: Instant) -> float:
        """Return the time [s] since `earlier` by the clock that advanced less.

        In a slow run an endpoint waits for the simulation; in a fast run it still needs its own wall time. A message is
        late only if it is late by both clocks.
        """
        return min((self.now.time_ns - earlier.time_ns) * 1e-9, self.now.wall - earlier.wall)
