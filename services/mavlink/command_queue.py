"""Commands to the autopilot, and its acknowledgements back to those who gave them."""

from collections.abc import Callable, Sequence
from typing import Any

from lapwing.messages import CommandAck, OperatorCommand
from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.mavlink.clock import Clock, Instant

TIMEOUT = 2.0  # [s] the autopilot gets to acknowledge
MAX_WAITING = 256  # commands that may wait for their acknowledgement

OnAcknowledgement = Callable[[Any], None]  # called with each Answer: some say only that it is in progress


class CommandQueue:
    """Numbers the commands and leads the acknowledgements back."""

    def __init__(self, clock: Clock, put: Callable[[OperatorCommand], None] | None):
        """Create an empty queue; `put` passes a command to the autopilot, None for a recorded flight."""
        self._clock, self._put = clock, put
        self.started = False  # the autopilot has spoken
        self._last = 0
        self._waiting: dict[int, tuple[OnAcknowledgement, Instant, str]] = {}

    @property
    def connected(self) -> bool:
        """True if an autopilot accepts commands."""
        return self._put is not None

    def put(
        self,
        kind: str,
        source: str,
        on_acknowledgement: OnAcknowledgement | None = None,
        values: Sequence[float] = (),
        text: str = "",
        items: Sequence[Any] = (),
    ) -> None:
        """Give a command.

        Args:
            kind: of OperatorCommand.
            source: sender, "system/component".
            on_acknowledgement: called with every acknowledgement; with one of our own where none comes.
            values: of OperatorCommand.
            text: of OperatorCommand.
            items: of OperatorCommand.
        """
        if self._put is None or not self.started or len(self._waiting) >= MAX_WAITING:
            if on_acknowledgement:
                on_acknowledgement(_rejection(self._refusal()))
            return
        self._last = self._last % 0xFFFFFFFF + 1
        if on_acknowledgement:
            self._waiting[self._last] = on_acknowledgement, self._clock.now, source
        self._put(OperatorCommand(kind, source, self._last, tuple(float(v) for v in values), text, tuple(items)))

    def _refusal(self) -> str:
        """Return the reason for rejecting a command now."""
        if self._put is None:
            return "a recorded flight takes no commands"
        return "too many at once" if self.started else "the vehicle is still starting"

    def acknowledge(self, acknowledgements: Sequence[Any]) -> None:
        """Handle acknowledgements of the autopilot."""
        for acknowledgement in acknowledgements:
            waiting = self._waiting.get(acknowledgement.id)
            if waiting is None or waiting[2] != acknowledgement.source:  # of another sender with its own numbers
                continue
            if acknowledgement.result == mavlink.MAV_RESULT_IN_PROGRESS:
                self._waiting[acknowledgement.id] = waiting[0], self._clock.now, waiting[2]
            else:
                del self._waiting[acknowledgement.id]
            waiting[0](acknowledgement)

    def step(self) -> None:
        """Reject what the autopilot leaves without an acknowledgement."""
        late = [n for n, (_, given, _) in self._waiting.items() if self._clock.since(given) > TIMEOUT]
        for number in late:
            on_acknowledgement, *_ = self._waiting.pop(number)
            on_acknowledgement(_rejection("the autopilot does not acknowledge"))


def _rejection(text: str) -> Any:
    return CommandAck(result=mavlink.MAV_RESULT_TEMPORARILY_REJECTED, text=text)
