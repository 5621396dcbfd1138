"""Operator commands from outside the lock step, merged into one message per tick.

The processes `mavlink` and `ros2`, and the run monitor for the page of `--view`, publish encoded OperatorInput messages
on the key `_operator/NAME` below the run's key prefix at any time. The autopilot stamps and records them.
"""

from collections.abc import Callable, Iterable, Sequence
from typing import Any

from lapwing.cosim.config.run_config import RunConfig
from lapwing.messages import OperatorCommand, OperatorInput, header

OPERATOR_KEY = "_operator"
UNREADABLE = "unreadable"  # kind of the command that replaces an undecodable message

Operator = Callable[[int], Iterable[OperatorCommand]]
"""Function of a tick that returns the commands received since its last call."""


def no_operator(_: int) -> Iterable[OperatorCommand]:
    """Return no commands."""
    return ()


def accepts_commands(member: RunConfig) -> bool:
    """Return True if the scene of a vehicle, given its run configuration alone, accepts commands."""
    return "autopilot" in member.services and bool(member.resolved["autopilot"]["accept_commands"])


class OperatorInbox:
    """Queues of received commands by vehicle; with several vehicles, the header's `frame_id` selects one."""

    def __init__(self, vehicles: Sequence[str], receive: Callable[[], tuple[int, bytes] | None]):
        """Create the queues; `receive` returns the next time [ns] and encoded OperatorInput, or None."""
        self._receive, self._first = receive, vehicles[0]
        self._queues: dict[str, list[Any]] = {vehicle: [] for vehicle in vehicles}

    def take(self, vehicle: str, _: int) -> list[Any]:
        """Remove and return the queued commands of a vehicle."""
        while received := self._receive():
            name, commands = decode_input(received[1])
            self._queues.get(name, self._queues[self._first]).extend(commands)
        queue, self._queues[vehicle] = self._queues[vehicle], []
        return queue


class AnsweredInbox(OperatorInbox):
    """Queues of commands with time stamps, which wait at each tick for the answer to the one before.

    A command takes effect one period after its stamp, in how ever many messages and at whatever time it arrives.
    """

    def __init__(
        self,
        vehicles: Sequence[str],
        wait: Callable[[Callable[[], str]], tuple[int, bytes]],
        interval_ns: int,
        period: int,
    ):
        """Create the queues.

        Args:
            vehicles: names.
            wait: returns the next stamp [ns] and encoded OperatorInput; its argument says for what it waits.
            interval_ns: duration of a tick [ns].
            period: ticks between two answers.
        """
        self._wait, self._first, self._interval_ns, self._period = wait, vehicles[0], interval_ns, period
        self._answers: dict[str, list[tuple[int, Any]]] = {vehicle: [] for vehicle in vehicles}
        self._answered = dict.fromkeys(vehicles, -1)  # newest stamp [ns]

    def take(self, vehicle: str, tick: int) -> list[Any]:
        """Remove and return the commands with stamps up to one period before a tick; wait for the newest of them."""
        due = (tick - self._period) * self._interval_ns
        while due >= 0 and self._answered[vehicle] < due:
            time_ns, payload = self._wait(
                lambda: f"the command of a ROS 2 node for {vehicle} with stamp {due * 1e-9:g} s"
            )
            name, commands = decode_input(payload)
            name = name if name in self._answers else self._first
            self._answers[name] += [(time_ns, command) for command in commands]
            self._answered[name] = max(self._answered[name], time_ns)
        result = [command for time_ns, command in self._answers[vehicle] if time_ns <= due]
        self._answers[vehicle] = [answer for answer in self._answers[vehicle] if answer[0] > due]
        return result


def decode_input(payload: bytes) -> tuple[str, tuple[Any, ...]]:
    """Return vehicle name and commands of an encoded OperatorInput; undecodable bytes become one invalid command."""
    try:
        message = OperatorInput.decode(payload)
        return message.header.frame_id, message.commands
    except ValueError as error:
        return "", (OperatorCommand(UNREADABLE, text=str(error)),)


def merge_commands(time_ns: int, commands: Iterable[OperatorCommand]) -> OperatorInput:
    """Return one message with the commands at `time_ns`."""
    return OperatorInput(header(time_ns, "world"), tuple(commands))
