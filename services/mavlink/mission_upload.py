"""An upload of items on its way, and its last acknowledgement, which may get lost."""

from typing import Any

from lapwing.services.mavlink.clock import Clock
from lapwing.services.mavlink.endpoint import Endpoint

RETRY, UPLOAD_TIMEOUT = (
    0.25,
    2.25,
)  # [s] before an item is asked for again at the latest, and before an upload is given up
SOONEST = 0.06  # [s] before an item is asked for again at the soonest; twice the round trip comes to it
REPEAT, REPEATS, REPEATS_LOSSY = 0.3, 2, 8  # [s] between two acknowledgements, and how many come after the first


class Upload:
    """Items that an endpoint is about to hand over, one after the other."""

    def __init__(self, endpoint: Endpoint, kind: int, count: int, clock: Clock):
        self.endpoint, self.kind, self.count = endpoint, kind, count
        self.items: list[Any] = []
        self.complete = False
        self.lossy = False  # something had to be asked for again
        self._clock = clock
        self._begun = self._asked = clock.now
        self._again = False  # the item was asked for more than once
        self._retry = RETRY

    @property
    def overdue(self) -> bool:
        """True if the next item must be requested again."""
        return not self.complete and self._clock.since(self._asked) >= self._retry

    @property
    def given_up(self) -> bool:
        """True if the next item did not arrive in time."""
        return self._clock.since(self._begun) >= UPLOAD_TIMEOUT

    def ask(self) -> int:
        """Record the request of the next item. Return its number."""
        self._asked = self._clock.now
        return len(self.items)

    def ask_again(self) -> None:
        """Record that the requested item was lost."""
        self._again = self.lossy = True

    def take(self, item: Any) -> None:
        """Append the next item."""
        if not self._again:  # else it is not known which request it answers
            round_trip = self._clock.since(self._asked)
            self._retry = min(RETRY, max(SOONEST + 2.0 * round_trip, 0.8 * self._retry))
        self.items.append(item)
        self._begun, self._again = self._clock.now, False


class Repeat:
    """A last acknowledgement that is sent again for a while: its client may wait for it in vain."""

    def __init__(self, upload: Upload, result: int, clock: Clock):
        self.endpoint, self.result = upload.endpoint, result
        self._left = REPEATS_LOSSY if upload.lossy else REPEATS
        self._clock, self._sent = clock, clock.now

    def due(self) -> bool:
        """Return True if it must be sent now."""
        if self._clock.since(self._sent) < REPEAT:
            return False
        self._left, self._sent = self._left - 1, self._clock.now
        return True

    @property
    def over(self) -> bool:
        """True if all repetitions were sent."""
        return self._left <= 0
