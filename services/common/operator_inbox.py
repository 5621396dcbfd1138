"""What comes from outside the lock step: joined into one message of the tick at which it applies.

The processes `mavlink` and `ros2` publish an encoded OperatorInput on the key `_operator/NAME` behind the run's key
prefix, at any time; the autopilot stamps and records what has come.
"""

from collections.abc import Callable, Iterable, Sequence
from typing import Any

from lapwing.messages import OperatorCommand, OperatorInput, header

OPERATOR_KEY = "_operator"
UNREADABLE = "unreadable"  # kind of the command that stands for bytes that are no message

Operator = Callable[[int], Iterable[OperatorCommand]]
"""Gives the commands that have come until a tick."""


def nobody(_: int) -> Iterable[OperatorCommand]:
    """An operator who never says anything."""
    return ()


class OperatorInbox:
    """Sorts what has come from outside by vehicle: of several, the header's `frame_id` has the name."""

    def __init__(self, vehicles: Sequence[str], arrived: Callable[[], tuple[int, bytes] | None]):
        """`arrived` gives the next encoded OperatorInput with its time, None where there is no other."""
        self._arrived, self._first = arrived, vehicles[0]
        self._waiting: dict[str, list[Any]] = {vehicle: [] for vehicle in vehicles}

    def take(self, vehicle: str, _: int) -> list[Any]:
        """The commands for a vehicle that have come."""
        while arrived := self._arrived():
            name, found = addressed(arrived[1])
            self._waiting.get(name, self._waiting[self._first]).extend(found)
        taken, self._waiting[vehicle] = self._waiting[vehicle], []
        return taken


def addressed(payload: bytes) -> tuple[str, tuple[Any, ...]]:
    """The vehicle's name and the commands of an encoded OperatorInput; bytes that are none become one command that will
    be refused."""
    try:
        found = OperatorInput.decode(payload)
        return found.header.frame_id, found.commands
    except ValueError as error:
        return "", (OperatorCommand(UNREADABLE, text=str(error)),)


def joined(time_ns: int, given: Iterable[OperatorCommand]) -> OperatorInput:
    """One message of the instant `time_ns`, the commands in their order."""
    return OperatorInput(header(time_ns, "world"), tuple(given))
