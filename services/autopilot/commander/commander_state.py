"""What the commander remembers from tick to tick: plain data, to be copied or pickled."""

from dataclasses import dataclass, field
from typing import Any, NamedTuple

from lapwing.services.autopilot.commander.commander_input import Constants
from lapwing.services.autopilot.commander.flight_mode import FlightMode
from lapwing.services.autopilot.commander.guidance import Guidance
from lapwing.services.autopilot.commander.modes import hold_mode
from lapwing.services.autopilot.commander.smoothing import PositionSmoothing
from lapwing.services.autopilot.estimator import SOURCES
from lapwing.services.common.failure_types import SOUND, Faults

TRAJECTORY_MODE = "mission"  # how the flight along the scene's own trajectory is called


class PendingArm(NamedTuple):
    """A command to arm that waits for the checks."""

    command: Any  # an `OperatorCommand`
    time_left: float  # [s]


class FailsafeTimer(NamedTuple):
    """A failsafe condition that holds."""

    elapsed: float  # since it began [s]
    acted: bool  # it has taken over


@dataclass
class State:
    """The commander's memory."""

    guidance: Guidance
    mode_name: str
    mode: FlightMode | None  # None: the scene's own trajectory is followed
    failsafe: str = ""  # reason of the failsafe in force
    failsafe_timers: dict[str, FailsafeTimer] = field(default_factory=dict)  # by reason, of the conditions that hold
    source_outage: list[float] = field(default_factory=lambda: [0.0] * len(SOURCES))  # lost or refused for so long [s]
    faults: Faults = field(default_factory=Faults)  # that are injected
    pending_arm: PendingArm | None = None
    on_ground_time: float = 0.0  # armed, but not flying [s]
    blocked_time: float = 0.0  # asked to sink without sinking [s]
    finish_requested: bool = False  # the run is over with the next disarming

    @property
    def on_trajectory(self) -> bool:
        """Whether the scene's own trajectory is followed."""
        return self.mode is None


def initial(constants: Constants) -> State:
    """Before the first tick: on the ground, disarmed."""
    values = {p.name: p.default for p in constants.parameters.values()}
    guidance = Guidance(values, PositionSmoothing((0.0, 0.0, constants.resting_height), 0.0))
    faults = Faults(motors=(SOUND,) * constants.rotors)
    if constants.has_trajectory:
        return State(guidance, TRAJECTORY_MODE, None, faults=faults)
    return State(guidance, hold_mode.NAME, hold_mode.Mode(constants, guidance), faults=faults)
