"""What the autopilot is given."""

from typing import Any, NamedTuple

from lapwing.dynamics.vector import Vec3
from lapwing.services.autopilot.controller_parameters import Airframe, Gains
from lapwing.services.autopilot.estimator import Estimator
from lapwing.services.common.autopilot_parameters import Parameter
from lapwing.services.common.controller_api import VehicleModel


class CustomCode(NamedTuple):
    """The user's own code in the place of a part of the autopilot."""

    name: str  # "module:Name"; the set-up carries the module's text
    options: dict[str, Any]  # handed to the constructor
    every: int  # ticks between two of its steps


class AutopilotSetup(NamedTuple):
    """An autopilot on its vehicle."""

    estimator: Estimator | None  # None: the truth is taken for the estimate
    start_world: Vec3  # [m] where the vehicle is put down
    imu_every: int  # ticks between two readings of the IMU
    gps_age: int  # readings of the IMU by which the receiver is late
    gains: Gains
    geometric: bool  # attitude error on SO(3) instead of angle by angle
    airframe: Airframe
    parameters: tuple[Parameter, ...]
    phases: tuple[str, ...]  # of the scene's trajectory; empty where none is followed
    operator: bool  # somebody may give commands
    plan: tuple[Any, ...]  # operator commands that come at the first tick
    estimate_every: int  # ticks between two messages of the estimate
    status_every: int
    answers_every: int
    controller: CustomCode | None = None  # None: the cascaded PID
    own_estimator: CustomCode | None = None
    vehicle: VehicleModel | None = None  # what the user's own code is told of it
    distance_sensor: str | None = None  # port of the sensor that tells how far the ground is
