"""The two clocks of a link: simulation time, which the vehicle keeps, and wall time, which its endpoints keep."""

from typing import NamedTuple


class Instant(NamedTuple):
    """A moment on both clocks."""

    time_ns: int = 0  # of the simulation
    wall: float = 0.0  # [s] monotonic


class Clock:
    """The present moment, and how long ago others were."""

    def __init__(self) -> None:
        self.now = Instant()

    def since(self, then: Instant) -> float:
        """Return the time [s] since `then` by the clock that advanced less.

        In a slow run an endpoint waits for the simulation; in a fast run it still needs its own wall time. A message is
        late only if it is late by both clocks.
        """
        return min((self.now.time_ns - then.time_ns) * 1e-9, self.now.wall - then.wall)
