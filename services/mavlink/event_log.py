"""The events of a run: numbered, and kept for whoever has missed one (MAVLink guide, "Events Interface")."""

from collections import deque
from collections.abc import Iterator
from typing import Any

from lapwing.services.mavlink.dialect import message_class

KEPT = 100  # events that can be sent again
ROUND = 1 << 16  # sequence numbers begin again after so many
ARGUMENTS = 40  # [bytes] of a message
ALL = 0  # destination of an event for everybody
RESET = 1  # MAV_EVENT_CURRENT_SEQUENCE_FLAGS_RESET: the numbers have begun anew
UNAVAILABLE = 0  # MAV_EVENT_ERROR_REASON_UNAVAILABLE


class EventLog:
    """The last events, by their sequence numbers."""

    def __init__(self) -> None:
        self.sequence = 0  # of the last event
        self._kept: deque[tuple[int, Any]] = deque(maxlen=KEPT)  # with their numbers

    def current(self) -> Any:
        """CURRENT_EVENT_SEQUENCE: a station that lacks the event of this number asks for it."""
        return message_class("CURRENT_EVENT_SEQUENCE")(self.sequence, 0 if self._kept else RESET)

    def add(self, number: int, level: int, arguments: bytes, time_ms: int) -> list[Any]:
        """The messages that tell of a new event.

        Args:
            number: its id.
            level: of its seriousness, for people and for logs alike.
            arguments: their bytes.
            time_ms: since the start [ms].
        """
        begins = [] if self._kept else [self.current()]
        self.sequence = (self.sequence + 1) % ROUND
        padded = list(arguments.ljust(ARGUMENTS, b"\0"))
        message = message_class("EVENT")(ALL, ALL, number, time_ms, self.sequence, level << 4 | level, padded)
        self._kept.append((self.sequence, message))
        return [*begins, message]

    def replies(self, first: int, last: int, address: tuple[int, int]) -> Iterator[Any]:
        """The events from one number to another, and in place of those that are not there the number of the next.

        Args:
            first: sequence number.
            last: sequence number, which may be lower: they begin again after the highest.
            address: system and component of whoever asks.
        """
        wanted = (last - first) % ROUND + 1
        found = dict(self._kept)

        def missing(number: int) -> Any:
            oldest = min(found, key=lambda sequence: (sequence - number) % ROUND, default=self.sequence)
            return message_class("RESPONSE_EVENT_ERROR")(*address, number, oldest, UNAVAILABLE)

        if wanted > KEPT:
            yield missing(first)
        for k in range(max(0, wanted - KEPT), wanted):
            number = (first + k) % ROUND
            yield found.get(number) or missing(number)
