"""Commands to the autopilot, and its answers to those who asked."""

from collections.abc import Callable, Sequence
from typing import Any

from messages import Answer, OperatorCommand
from services.mavlink.clock import Clock, Instant
from services.mavlink.dialect import mavlink

PATIENCE = 2.0  # [s] the autopilot gets to answer
MOST = 256  # commands that may wait for an answer

Answered = Callable[[Any], None]  # called with each Answer: some say only that it is in progress


class Requests:
    """Numbers the commands and leads the answers back."""

    def __init__(self, clock: Clock, put: Callable[[OperatorCommand], None] | None):
        """`put` hands a command to the autopilot; None: there is none, this is a recorded flight."""
        self._clock, self._put = clock, put
        self._last = 0
        self._waiting: dict[int, tuple[Answered, Instant]] = {}

    @property
    def taken(self) -> bool:
        """Whether there is an autopilot that takes commands."""
        return self._put is not None

    def ask(
        self,
        kind: str,
        source: str,
        answered: Answered | None = None,
        values: Sequence[float] = (),
        text: str = "",
        items: Sequence[Any] = (),
    ) -> None:
        """Give a command; `answered` gets every answer, also when there is none, in words of our own."""
        if self._put is None or len(self._waiting) >= MOST:
            if answered:
                answered(_refusal("a recorded flight takes no commands" if self._put is None else "too many at once"))
            return
        self._last = self._last % 0xFFFFFFFF + 1
        if answered:
            self._waiting[self._last] = answered, self._clock.now
        self._put(OperatorCommand(kind, source, self._last, tuple(float(v) for v in values), text, tuple(items)))

    def take(self, answers: Sequence[Any]) -> None:
        """The autopilot has answered."""
        for answer in answers:
            waiting = self._waiting.get(answer.id)
            if waiting is None:
                continue
            if answer.result == mavlink.MAV_RESULT_IN_PROGRESS:
                self._waiting[answer.id] = waiting[0], self._clock.now
            else:
                del self._waiting[answer.id]
            waiting[0](answer)

    def step(self) -> None:
        """Answer for an autopilot that does not."""
        late = [n for n, (_, asked) in self._waiting.items() if self._clock.since(asked) > PATIENCE]
        for number in late:
            answered, _ = self._waiting.pop(number)
            answered(_refusal("the autopilot does not answer"))


def _refusal(text: str) -> Any:
    return Answer(result=mavlink.MAV_RESULT_TEMPORARILY_REJECTED, text=text)
