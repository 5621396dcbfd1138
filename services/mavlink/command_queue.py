"""Commands to the autopilot, and its acknowledgements to their senders."""

from collections.abc import Callable, Sequence
from typing import Any

from lapwing.messages import CommandAck, OperatorCommand
from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.mavlink.clock import Clock, Instant

TIMEOUT = 2.0  # [s] for the autopilot to acknowledge a command
MAX_WAITING = 256  # commands that may wait for their acknowledgement

OnAcknowledgement = Callable[[Any], None]  # called with each CommandAck; some only report progress


class CommandQueue:
    """Queue that numbers commands, and passes each acknowledgement to the sender of its command."""

    def __init__(self, clock: Clock, put: Callable[[OperatorCommand], None] | None):
        """Create an empty queue; `put` passes a command to the autopilot, None for a recorded flight."""
        self._clock, self._put = clock, put
        self.started = False  # the autopilot has published its first message
        self._early: list[OperatorCommand] = []  # to send at its start
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
        surely_accepted: bool = False,
    ) -> None:
        """Send a command; see `OperatorCommand` for its fields.

        Args:
            kind: kind of command.
            source: sender, "system/component".
            on_acknowledgement: called with every acknowledgement, and with a rejection after `TIMEOUT` without one.
            values: numeric arguments.
            text: text argument.
            items: mission items.
            surely_accepted: True if the autopilot accepts it in every state; before the start it is acknowledged at
                once and sent at the start.
        """
        if surely_accepted and self._put and not self.started and len(self._early) < MAX_WAITING:
            self._early.append(OperatorCommand(kind, source, 0, tuple(float(v) for v in values), text, tuple(items)))
            if on_acknowledgement:
                on_acknowledgement(CommandAck(result=mavlink.MAV_RESULT_ACCEPTED, value=values[0]))
            return
        if self._put is None or not self.started or len(self._waiting) >= MAX_WAITING:
            if on_acknowledgement:
                on_acknowledgement(_rejection(self._rejection_reason()))
            return
        self._last = self._last % 0xFFFFFFFF + 1
        if on_acknowledgement:
            self._waiting[self._last] = on_acknowledgement, self._clock.now, source
        self._put(OperatorCommand(kind, source, self._last, tuple(float(v) for v in values), text, tuple(items)))

    def start(self) -> None:
        """Send the commands that waited for the start of the autopilot; called with each of its messages."""
        if self.started:
            return
        self.started = True
        for command in self._early:
            self.put(command.kind, command.source, None, command.values, command.text, command.items)
        self._early.clear()

    def _rejection_reason(self) -> str:
        """Return the reason for rejecting a command now."""
        if self._put is None:
            return "a recorded flight accepts no commands"
        return "too many at once" if self.started else "the vehicle is still starting"

    def acknowledge(self, acknowledgements: Sequence[Any]) -> None:
        """Handle acknowledgements of the autopilot."""
        for acknowledgement in acknowledgements:
            waiting = self._waiting.get(acknowledgement.id)
            if waiting is None or waiting[2] != acknowledgement.source:  # another sender with its own numbers
                continue
            if acknowledgement.result == mavlink.MAV_RESULT_IN_PROGRESS:
                self._waiting[acknowledgement.id] = waiting[0], self._clock.now, waiting[2]
            else:
                del self._waiting[acknowledgement.id]
            waiting[0](acknowledgement)

    def step(self) -> None:
        """Reject the commands that the autopilot has not acknowledged in time."""
        if not self._waiting:
            return
        expired = [n for n, (_, sent, _) in self._waiting.items() if self._clock.since(sent) > TIMEOUT]
        for number in expired:
            on_acknowledgement, *_ = self._waiting.pop(number)
            on_acknowledgement(_rejection("the autopilot does not acknowledge"))


def _rejection(text: str) -> Any:
    return CommandAck(result=mavlink.MAV_RESULT_TEMPORARILY_REJECTED, text=text)
