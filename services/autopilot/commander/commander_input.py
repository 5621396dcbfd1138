"""What the commander is told: the constants of a vehicle, once, and a view of each tick."""

from collections.abc import Mapping
from typing import Any, NamedTuple

from lapwing.services.autopilot.estimator.filter_state import GPS
from lapwing.services.autopilot.interface import Setpoint
from lapwing.services.common.autopilot_parameters import Parameter
from lapwing.services.common.ports import StateEstimate

POSITION_LOST = 64 | 128 | 1 << GPS  # bits of the estimate's health


class Constants(NamedTuple):
    """What does not change during a run."""

    parameters: Mapping[str, Parameter]  # by name
    resting_height: float  # world z of the vehicle on the ground [m]
    gravity: float  # [m/s^2]
    hover_thrust: float  # thrust of hovering over the maximum thrust
    has_trajectory: bool  # the run begins along the scene's own trajectory
    has_operator: bool  # somebody may give commands
    failing: tuple[str, ...] = ()  # units whose failures may be injected
    rotors: int = 4


class CommanderInput(NamedTuple):
    """All that the commander is told at one tick."""

    dt: float  # length of the tick [s]
    estimate: StateEstimate  # the newest that the commander was shown
    estimate_interval: float  # from the one shown before to this one, where it is new at this tick, else 0 [s]
    battery_charge: float  # fraction; NaN: not known
    failed_motor: int  # its number, from 1; 0: none
    setpoint: Setpoint | None  # of the scene's trajectory; None without one
    thrust: float  # asked for by the controller at the last tick, over that of hovering
    motors_cut: bool  # the controller has cut the motors off after a landing
    commands: tuple[Any, ...] = ()  # the operator's, as `OperatorCommand` messages, in their order

    @property
    def position_lost(self) -> bool:
        """Whether the estimate is not to be trusted as to where the vehicle is."""
        return bool(self.estimate.health & POSITION_LOST)
