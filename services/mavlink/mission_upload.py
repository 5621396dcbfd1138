"""Active upload of items, and repetition of its last acknowledgement, which may be lost."""

from typing import Any

from lapwing.services.mavlink.clock import Clock
from lapwing.services.mavlink.endpoint import Endpoint

RETRY, UPLOAD_TIMEOUT = 0.25, 2.25  # [s] longest time to the next request of an item; [s] without an item
SOONEST = 0.06  # [s] shortest time to the next request of an item, plus twice the round trip
REPEAT, REPEATS, REPEATS_LOSSY = 0.3, 2, 8  # [s] between two acknowledgements; repetitions, and on a lossy link


class Upload:
    """Upload of items from an endpoint, one by one."""

    def __init__(self, endpoint: Endpoint, kind: int, count: int, clock: Clock):
        self.endpoint, self.kind, self.count = endpoint, kind, count
        self.items: list[Any] = []
        self.complete = False
        self.lossy = False  # a request was repeated
        self._clock = clock
        self._last_item = self._requested = clock.now
        self._repeated = False  # the item was requested more than once
        self._retry = RETRY

    @property
    def overdue(self) -> bool:
        """True if the next item must be requested again."""
        return not self.complete and self._clock.since(self._requested) >= self._retry

    @property
    def timed_out(self) -> bool:
        """True if the next item did not arrive in time."""
        return self._clock.since(self._last_item) >= UPLOAD_TIMEOUT

    def next_request(self) -> int:
        """Record the request of the next item. Return its number."""
        self._requested = self._clock.now
        return len(self.items)

    def note_lost_request(self) -> None:
        """Record that the requested item was lost."""
        self._repeated = self.lossy = True

    def append(self, item: Any) -> None:
        """Append the next item."""
        if not self._repeated:  # otherwise the round trip is unknown
            round_trip = self._clock.since(self._requested)
            self._retry = min(RETRY, max(SOONEST + 2.0 * round_trip, 0.8 * self._retry))
        self.items.append(item)
        self._last_item, self._repeated = self._clock.now, False


class Repeat:
    """Repetition of a last acknowledgement, in case it was lost."""

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
