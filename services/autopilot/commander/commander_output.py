"""What the commander asks for in return."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from lapwing.messages import CommandAck
from lapwing.services.autopilot.interface import Setpoint
from lapwing.services.common.failure_types import Faults


class Status(NamedTuple):
    """What the vehicle is doing, as far as the commander decides it."""

    mode: str
    phase: str  # part of the mode; "" while the scene's trajectory is followed, which has phases of its own
    armed: bool  # once the trajectory was left; while it is followed, the controller's stage says it
    finished: bool  # the run is over; on the trajectory the controller says it
    failsafe: str  # reason of the failsafe in force; "": none
    mission_current: int  # item that is flown
    mission_count: int
    mission_reached: int  # the last item that was reached
    mission_state: int  # as MAVLink's MISSION_STATE numbers it
    offboard_fresh: bool  # setpoints from outside are coming
    prearm: tuple[str, ...]  # why it cannot be armed; to be left out while the motors run on the trajectory
    home: tuple[float, float, float]  # world x, y, and height of the ground [m]
    released: bool  # the gripper is to be open
    battery_warning: int  # 0 none, 1 low, 2 critical, 3 nearly empty


class CommanderOutput(NamedTuple):
    """All that the commander asks for at one tick."""

    setpoint: Setpoint | None  # to be followed; None: the scene's trajectory
    parameters: Mapping[str, float] | None  # values of all, where one has changed
    faults: Faults | None  # that are injected, where one has changed
    acknowledgements: tuple[Any, ...]  # of commands, as `CommandAck` messages
    texts: tuple[str, ...]  # for the operator
    reset_controller: bool  # the vehicle is on the ground: the controller must be as before a flight
    estimate_every_tick: bool  # the setpoint was made from the estimate: show a new one at the next tick
    motor_voltage: (
        tuple[float, ...] | None
    )  # of each motor, in the place of the controller's [V]; None: the controller's
    status: Status
    quiet: float  # [s] from this tick on in which every request would be this one (`attention.quiet_time`)


@dataclass
class OperatorMessages:
    """What is to be told at one tick, while it is collected."""

    acknowledgements: list[Any] = field(default_factory=list)
    texts: list[str] = field(default_factory=list)
    parameters: dict[str, float] | None = None
    faults: Faults | None = None

    def say(self, text: str) -> None:
        """Tell the operator."""
        self.texts.append(text)

    def acknowledge(self, command: Any, result: int, text: str = "", value: float = 0.0) -> None:
        """Tell whoever gave a command what became of it."""
        self.acknowledgements.append(CommandAck(command.source, command.id, result, float(result == 0), text, value))
