"""State of the commander: plain data that can be copied or pickled."""

import math
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from lapwing.services.autopilot.commander.commander_input import Constants
from lapwing.services.autopilot.commander.flight_mode import FlightMode
from lapwing.services.autopilot.commander.guidance import Guidance
from lapwing.services.autopilot.commander.modes import hold_mode
from lapwing.services.autopilot.commander.smoothing import PositionSmoothing
from lapwing.services.autopilot.estimator import SOURCES
from lapwing.services.common.failure_types import SOUND, Faults
from lapwing.services.common.ports import ImuSelection

TRAJECTORY_MODE = "mission"  # mode name along the scene's trajectory


class PendingArm(NamedTuple):
    """An arm command that waits for the pre-arm checks."""

    command: Any  # an `OperatorCommand`
    time_left: float  # [s]


class FailsafeTimer(NamedTuple):
    """Timer of an active failsafe condition."""

    elapsed: float  # [s]
    acted: bool  # the failsafe action was taken


@dataclass
class State:
    """State of the commander."""

    guidance: Guidance
    mode_name: str
    mode: FlightMode | None  # None: the scene's trajectory
    failsafe: str = ""  # reason of the active failsafe, or of the stop of the motors in flight
    failsafe_timers: dict[str, FailsafeTimer] = field(default_factory=dict)  # active conditions by reason
    source_outage: list[float] = field(default_factory=lambda: [0.0] * len(SOURCES))  # [s] of lost or rejected sources
    faults: Faults = field(default_factory=Faults)  # injected
    pending_arm: PendingArm | None = None
    on_ground_time: float = 0.0  # [s] armed on the ground
    stopped_time: float = 0.0  # [s] at rest with low direct motor voltages, or after a fall
    lying_time: float = 0.0  # [s] on the side or back with motors
    held_time: float = 0.0  # [s] at rest far from the setpoint
    fall_time: float = math.inf  # [s] left for the fall after the motors stopped in flight; infinity without
    imu_selection: ImuSelection = field(default_factory=ImuSelection)  # last one announced

    @property
    def on_trajectory(self) -> bool:
        """True along the scene's trajectory."""
        return self.mode is None


def initial(constants: Constants) -> State:
    """Return the initial state: on the ground, disarmed."""
    values = {p.name: p.default for p in constants.parameters.values()}
    guidance = Guidance(values, PositionSmoothing((0.0, 0.0, constants.resting_height), 0.0))
    sound = (SOUND,) * constants.imus
    faults = Faults(gyro=sound, accelerometer=sound, motors=(SOUND,) * constants.rotors)
    if constants.has_trajectory:
        return State(guidance, TRAJECTORY_MODE, None, faults=faults)
    return State(guidance, hold_mode.NAME, hold_mode.Mode(constants, guidance), faults=faults)
