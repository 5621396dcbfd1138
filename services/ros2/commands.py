"""Commands of other ROS 2 nodes: topics, and conversion of their messages for the autopilot.

Frames and units are the same on both sides: ENU, FLU, SI.
"""

import itertools
import math
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

from lapwing.dynamics.lie.quaternion import Quaternion, to_roll_pitch_yaw
from lapwing.messages import (
    Actuators,
    Bool,
    OperatorCommand,
    OperatorInput,
    PoseStamped,
    Setpoint,
    String,
    TwistStamped,
    stamp_ns,
)

SOURCE = "ros2"
WORLD = "world"
_NONE = (math.nan,) * 3
CommandValues = tuple[str, tuple[float, ...]]  # kind and values of an OperatorCommand


class CommandTopic(NamedTuple):
    """Topic on which commands are accepted."""

    name: str  # after the name of the vehicle
    message: Any
    to_command: Callable[[Any], CommandValues]


def _pose(m: Any) -> CommandValues:
    _check_frame(m)
    q = m.pose.orientation
    yaw = to_roll_pitch_yaw(Quaternion(q.w, q.x, q.y, q.z))[2]
    return "offboard_position", (*m.pose.position, *_NONE, *_NONE, yaw, math.nan)


def _velocity(m: Any) -> CommandValues:
    _check_frame(m)
    return "offboard_position", (*_NONE, *m.twist.linear, *_NONE, math.nan, m.twist.angular.z)


def _setpoint(m: Any) -> CommandValues:
    _check_frame(m)
    return "offboard_position", (*m.position, *m.velocity, *m.acceleration, m.yaw, m.yaw_rate)


def _motors(m: Any) -> CommandValues:
    return "offboard_motors", tuple(m.motor_voltage)


def _check_frame(m: Any) -> None:
    if m.header.frame_id not in ("", WORLD):
        raise ValueError(f"frame {m.header.frame_id}: expected {WORLD}")


ACCEPTED = (
    CommandTopic("command/arm", Bool, lambda m: ("arm" if m.data else "disarm", ())),
    CommandTopic("command/mode", String, lambda m: (m.data, ())),
    CommandTopic("command/pose", PoseStamped, _pose),
    CommandTopic("command/velocity", TwistStamped, _velocity),
    CommandTopic("command/setpoint", Setpoint, _setpoint),
    CommandTopic("command/motors", Actuators, _motors),
)
OPERATOR = "command/operator"  # accepts an OperatorInput, with any command


class Commands:
    """Converter of messages into commands of the autopilot, with counts."""

    def __init__(self, vehicle: str):
        """Create the converter of a vehicle's commands."""
        self.vehicle = vehicle
        self._accepted = {f"/{vehicle}/{a.name}": a for a in ACCEPTED}
        self._operator = f"/{vehicle}/{OPERATOR}"
        self.messages = {topic: a.message for topic, a in self._accepted.items()} | {self._operator: OperatorInput}
        self.accepted_count, self.rejected_count = 0, 0
        self.last_error = ""
        self._numbers = itertools.count(1)

    def stamp(self, topic: str, payload: bytes) -> int:
        """Return the time stamp of a message [ns]; 0 without one."""
        try:
            message = self.messages[topic].decode(payload)
        except ValueError:
            return 0
        return stamp_ns(message.header) if hasattr(message, "header") else 0

    def read(self, topic: str, payload: bytes) -> tuple[Any, ...]:
        """Return the commands of a message; () if it is rejected."""
        try:
            result = tuple(self._read(topic, payload))
        except ValueError as error:
            self.rejected_count, self.last_error = self.rejected_count + 1, f"{topic}: {error}"
            return ()
        self.accepted_count += len(result)
        return result

    def _read(self, topic: str, payload: bytes) -> Iterable[Any]:
        if topic == self._operator:
            commands = OperatorInput.decode(payload).commands
            return [command._replace(source=f"{SOURCE}/{command.source}") for command in commands]
        accepted = self._accepted[topic]
        kind, values = accepted.to_command(accepted.message.decode(payload))
        return [OperatorCommand(kind, SOURCE, next(self._numbers), tuple(values))]

    def report(self) -> str:
        """Return the line of the final report; "" if no command arrived."""
        if not self.accepted_count and not self.rejected_count:
            return ""
        rejected = (
            f", {self.rejected_count} messages rejected, the last one: {self.last_error}" if self.rejected_count else ""
        )
        return f"{self.accepted_count} commands accepted{rejected}"
