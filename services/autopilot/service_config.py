"""Resolved configuration of the autopilot."""

import math
from typing import Any, NamedTuple

from lapwing.dynamics.vector import Vec3
from lapwing.services.autopilot.controller_parameters import Airframe, Gains
from lapwing.services.autopilot.estimator import Estimator
from lapwing.services.autopilot.land_detector import Thresholds
from lapwing.services.common.autopilot_parameters import Parameter
from lapwing.services.common.controller_api import VehicleModel


class CustomCode(NamedTuple):
    """User code in the autopilot."""

    name: str  # "module:Name"; the run configuration stores the module's text
    options: dict[str, Any]  # options of the constructor
    every: int  # [ticks] between two steps


class AutopilotConfig(NamedTuple):
    """Configuration of an autopilot."""

    estimator: Estimator | None  # None: ground truth or user code
    start_world: Vec3  # [m] start position
    imu_every: int  # [ticks] between two IMU readings
    gps_age: int  # delay of the receiver in IMU readings
    gains: Gains
    geometric: bool  # attitude error on SO(3) instead of Euler angles
    airframe: Airframe
    parameters: tuple[Parameter, ...]
    phases: tuple[str, ...]  # phases of the scene's trajectory; empty without one
    operator: bool  # commands are accepted
    estimate_every: int  # [ticks] between two messages of the estimate
    status_every: int
    answers_every: int
    plan: tuple[Any, ...] = ()  # operator commands at the first tick
    controller: CustomCode | None = None  # None: the cascaded PID
    own_estimator: CustomCode | None = None
    vehicle: VehicleModel | None = None  # vehicle parameters for user code
    imus: int = 1  # units that the autopilot votes on
    distance_sensor: str | None = None  # port of the sensor of the distance to the ground
    landing: Thresholds = Thresholds()
    gyro_range: float = math.inf  # [rad/s]

    @property
    def height_known(self) -> bool:
        """True if the height above the ground is measured, as far as the estimator uses it."""
        return self.distance_sensor is not None or (self.estimator is None and self.own_estimator is None)

    @property
    def has_gps(self) -> bool:
        """True unless SYS_HAS_GPS is 0 at the start."""
        return all(p.default != 0.0 for p in self.parameters if p.name == "SYS_HAS_GPS")  # absent from former logs
