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
    position_gain: float = Field(default=3.0, ge=0.0)  # [1/s^2] acceleration per position error
    velocity_gain: float = Field(default=3.0, ge=0.0)  # [1/s] acceleration per velocity error
    integral_gain: float = Field(default=0.6, ge=0.0)  # [1/s^3] acceleration per integral of the position error
    yaw_gain: float = Field(default=2.0, ge=0.0)  # [1/s] yaw rate per yaw error
