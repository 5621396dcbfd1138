"""Events of a run, numbered and stored for receivers that have missed one (MAVLink guide, "Events Interface")."""

from collections import deque
from collections.abc import Iterator
from typing import Any

from lapwing.services.common.mavlink.dialect import message_class

CAPACITY = 100  # events that can be sent again
ROUND = 1 << 16  # modulus of the sequence numbers
ARGUMENTS = 40  # [bytes] of a message
ALL = 0  # destination of an event for all receivers
RESET = 1  # MAV_EVENT_CURRENT_SEQUENCE_FLAGS_RESET: the numbers have restarted
UNAVAILABLE = 0  # MAV_EVENT_ERROR_REASON_UNAVAILABLE


class EventLog:
    """Last `CAPACITY` events by sequence number."""

    def __init__(self) -> None:
        self.sequence = 0  # sequence number of the last event
        self._events: deque[tuple[int, Any]] = deque(maxlen=CAPACITY)  # (sequence number, message)

    def current(self) -> Any:
        """Return CURRENT_EVENT_SEQUENCE, by which a station detects missing events."""
        return message_class("CURRENT_EVENT_SEQUENCE")(self.sequence, 0 if self._events else RESET)

    def add(self, number: int, level: int, arguments: bytes, time_ms: int) -> list[Any]:
        """Append an event. Return the messages that report it.

        Args:
            number: event id.
            level: severity, both external and internal.
            arguments: encoded arguments.
            time_ms: time since the start [ms].
        """
        announcement = [] if self._events else [self.current()]
        self.sequence = (self.sequence + 1) % ROUND
        padded = list(arguments.ljust(ARGUMENTS, b"\0"))
        message = message_class("EVENT")(ALL, ALL, number, time_ms, self.sequence, level << 4 | level, padded)
        self._events.append((self.sequence, message))
        return [*announcement, message]

    def replies(self, first: int, last: int, address: tuple[int, int]) -> Iterator[Any]:
        """Yield the events of a range of sequence numbers; for a missing one, the number of the next.

        Args:
            first: sequence number.
            last: sequence number; may be lower than `first`, since numbers wrap around.
            address: system and component of the requesting endpoint.
        """
        count = (last - first) % ROUND + 1
        stored = dict(self._events)

        def error_message(number: int) -> Any:
            oldest = min(stored, key=lambda sequence: (sequence - number) % ROUND, default=self.sequence)
            return message_class("RESPONSE_EVENT_ERROR")(*address, number, oldest, UNAVAILABLE)

        if count > CAPACITY:
            yield error_message(first)
        for k in range(max(0, count - CAPACITY), count):
            number = (first + k) % ROUND
            yield stored.get(number) or error_message(number)
