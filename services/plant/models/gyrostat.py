"""Gyrostat satellite with optional attitude control.

The parameters that are not zero select the case: blocked rotors (no `rotor_momentum`), spinning rotors
(`rotor_momentum`), friction (`damping`) or feedback (gains).
"""

from typing import ClassVar

from pydantic import Field

from lapwing.cosim.config.run_config import ServiceConfig
from lapwing.cosim.scene import Scene, SceneTable
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.lie.quaternion import Quaternion, exp
from lapwing.dynamics.vector import ZERO
from lapwing.dynamics.vehicles.rigid_body import RigidBody
from lapwing.papers.gyrostat import GyrostatParameters
from lapwing.services.common.ports import TrueState
from lapwing.services.common.schemas.run_schema import Triple
from lapwing.services.plant.models._common import autonomous, check_system, reject_other_tables, require_tables

Wxyz = tuple[float, float, float, float]


class Gyrostat(SceneTable):
    """The satellite, its rotors and its control (theory, eqs. (7.6) to (7.9))."""

    TABLE: ClassVar[str] = "gyrostat"
    OPTIONAL: ClassVar[bool] = True
    inertia: Triple  # [kg m^2] principal moments of the platform with its rotors
    rotor_momentum: Triple = ZERO  # [kg m^2/s] of the rotors; mean value of the third
    forcing_amplitude: float = 0.0  # ratio to the mean of the third rotor's speed
    forcing_frequency: float = Field(default=0.0, ge=0.0)  # [rad/s] of the forcing torque
    damping: float = Field(default=0.0, ge=0.0)  # [N m s] about z
    linear_gain: Triple = ZERO  # [N m s] torque per rate error
    cubic_gain: Triple = ZERO  # [N m s^3] torque per cube of the rate error
    desired_rate: float = 0.0  # [rad/s] about each axis
    attitude_gain: float = Field(default=0.0, ge=0.0)  # [N m] towards `target_rotation`
    rate_gain: float = Field(default=0.0, ge=0.0)  # [N m s] torque per rate error
    target_rotation: Triple = ZERO  # [rad] rotation vector of the desired attitude
    initial_attitude: Wxyz = Field(default=(1.0, 0.0, 0.0, 0.0), strict=False)  # quaternion w, x, y, z
    initial_rate: Triple  # [rad/s] body frame


def check(scene: Scene) -> None:
    """Check that the scene describes a valid satellite and has no table that it cannot use."""
    require_tables(scene, "gyrostat")
    reject_other_tables(scene)
    check_system(scene, *system(scene))


def resolve(scene: Scene) -> ServiceConfig:
    """Return the configuration of the satellite's plant."""
    return autonomous(scene, *system(scene), TrueState())


def system(scene: Scene) -> tuple[GyrostatParameters, RigidBody]:
    """Return the parameters and the initial state."""
    g = scene[Gyrostat]
    for axis, moment in zip("xyz", g.inertia, strict=True):
        if not moment > 0.0:
            raise ConfigError("gyrostat.inertia", f"got {moment:g} about {axis}", "principal moments above 0")
    p = GyrostatParameters(
        g.inertia, g.rotor_momentum, g.forcing_amplitude, g.forcing_frequency, g.damping, g.linear_gain, g.cubic_gain,
        g.desired_rate, g.attitude_gain, g.rate_gain, exp(g.target_rotation),
    )  # fmt: skip
    return p, RigidBody(Quaternion(*g.initial_attitude), g.initial_rate)
