"""The `[betaflight]` table of a scene: limits and gains of the pilot that flies the trajectory by RC channels."""

from typing import ClassVar

from pydantic import Field

from lapwing.cosim.scene import SceneTable


class Betaflight(SceneTable):
    """Pilot of Betaflight: position control through the sticks in ANGLE mode."""

    TABLE: ClassVar[str] = "betaflight"
    OPTIONAL: ClassVar[bool] = True
    tilt_limit_deg: float = Field(default=30.0, gt=0.0, le=60.0)  # [deg] at full stick; the firmware's angle_limit
    yaw_rate_limit_deg: float = Field(default=200.0, gt=0.0, le=1000.0)  # [deg/s] at full stick
    position_gain: float = Field(default=3.0, ge=0.0)  # [1/s^2]
    velocity_gain: float = Field(default=3.0, ge=0.0)  # [1/s]
    integral_gain: float = Field(default=0.6, ge=0.0)  # [1/s^3]
    yaw_gain: float = Field(default=2.0, ge=0.0)  # [1/s]
    clock_rate: float = Field(default=1.0, ge=0.02, le=1.0)  # firmware's time over wall time; below 1: a busy machine
