"""What comes from outside the lock step: joined into one message of the tick at which it applies.

Whoever operates a vehicle publishes an encoded OperatorInput on the key `_operator` behind the run's key prefix, at any
time; the autopilot stamps and records what has come.
"""

from collections.abc import Callable, Iterable
from typing import Any

from messages import OperatorCommand, OperatorInput, header

OPERATOR_KEY = "_operator"
UNREADABLE = "unreadable"  # kind of the command that stands for bytes that are no message

Operator = Callable[[int], Iterable[OperatorCommand]]
"""Gives the commands that have come until a tick."""


def nobody(_: int) -> Iterable[OperatorCommand]:
    """An operator who never says anything."""
    return ()


def commands(payload: bytes) -> tuple[Any, ...]:
    """The commands of an encoded OperatorInput; bytes that are none become one command that will be refused."""
    try:
        return OperatorInput.decode(payload).commands
    except ValueError as error:
        return (OperatorCommand(UNREADABLE, text=str(error)),)


def joined(time_ns: int, given: Iterable[OperatorCommand]) -> OperatorInput:
    """One message of the instant `time_ns`, the commands in their order."""
    return OperatorInput(header(time_ns, "world"), tuple(given))
