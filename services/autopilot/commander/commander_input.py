"""Inputs of the commander: constants of a vehicle and inputs of a tick."""

from collections.abc import Mapping
from typing import Any, NamedTuple

from lapwing.services.autopilot.estimator.filter_state import GPS
from lapwing.services.common.autopilot_parameters import Parameter
from lapwing.services.common.ports import ImuSelection, Setpoint, StateEstimate

POSITION_LOST = 64 | 128 | 1 << GPS  # bits of the estimate's health


class Constants(NamedTuple):
    """Constants of a run."""

    parameters: Mapping[str, Parameter]  # by name
    resting_height: float  # world z of the vehicle on the ground [m]
    gravity: float  # [m/s^2]
    hover_thrust: float  # over the maximum thrust
    has_trajectory: bool  # the run starts along the scene's trajectory
    has_operator: bool  # commands are accepted
    failing: tuple[str, ...] = ()  # units whose failures may be injected
    rotors: int = 4
    imus: int = 1
    has_gps: bool = True
    height_known: bool = False  # the height above the ground is measured


class CommanderInput(NamedTuple):
    """Inputs of a tick."""

    dt: float  # length of the tick [s]
    estimate: StateEstimate  # the newest one passed to the commander
    estimate_interval: float  # [s] since the previous one, 0 if it is not new at this tick
    battery_charge: float  # fraction; NaN: unknown
    failed_motor: int  # its number, from 1; 0: none
    setpoint: Setpoint | None  # setpoint of the scene's trajectory; None without one
    thrust: float  # commanded at the last tick, over the hover thrust
    motors_cut: bool  # by the controller after a landing
    imu_selection: ImuSelection = ImuSelection()  # result of the vote between the IMUs
    commands: tuple[Any, ...] = ()  # `OperatorCommand` messages in order

    @property
    def position_lost(self) -> bool:
        """True if the estimated position is not reliable."""
        return bool(self.estimate.health & POSITION_LOST)
