"""Outputs of the commander."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from lapwing.messages import CommandAck
from lapwing.services.common.failure_types import Faults
from lapwing.services.common.ports import Setpoint


class Status(NamedTuple):
    """Status of the vehicle from the commander."""

    mode: str
    phase: str  # part of the mode; "" along the scene's trajectory, which has its own phases
    armed: bool  # False along the trajectory, where the land detector decides
    finished: bool  # the run is over; False along the trajectory, where the controller decides
    failsafe: str  # reason of the active failsafe; "": none
    mission_current: int  # index of the current item
    mission_count: int
    mission_reached: int  # index of the last reached item
    mission_state: int  # MISSION_STATE of MAVLink
    offboard_available: bool  # offboard setpoints are available
    arming_blockers: tuple[str, ...]  # arming blockers; ignored while the motors run along the trajectory
    home: tuple[float, float, float]  # world x, y, and height of the ground [m]
    released: bool  # open the gripper
    battery_warning: int  # 0 none, 1 low, 2 critical, 3 nearly empty


class CommanderOutput(NamedTuple):
    """Outputs of a tick."""

    setpoint: Setpoint | None  # None: the scene's trajectory
    parameters: Mapping[str, float] | None  # all values, if one has changed
    faults: Faults | None  # injected failures, if one has changed
    acknowledgements: tuple[Any, ...]  # `CommandAck` messages
    texts: tuple[str, ...]  # status texts for the operator
    reset_controller: bool  # the vehicle is on the ground
    estimate_every_tick: bool  # the setpoint depends on the estimate: pass a new one at the next tick
    motor_voltage: tuple[float, ...] | None  # direct voltages [V]; None: the controller's
    status: Status
    valid_for: float  # [s] for which the output stays valid (`wakeup_conditions.time_without_changes`)


@dataclass
class OperatorMessages:
    """Messages of a tick for the operator, and changed parameters and failures."""

    acknowledgements: list[Any] = field(default_factory=list)
    texts: list[str] = field(default_factory=list)
    parameters: dict[str, float] | None = None
    faults: Faults | None = None

    def send_text(self, text: str) -> None:
        """Send a status text."""
        self.texts.append(text)

    def acknowledge(self, command: Any, result: int, text: str = "", value: float = 0.0) -> None:
        """Send the acknowledgement of a command."""
        self.acknowledgements.append(CommandAck(command.source, command.id, result, float(result == 0), text, value))
