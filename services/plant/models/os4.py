"""OS4 quadrotor without autopilot, with constant rotor speeds or motors at constant voltages."""

import math
from typing import ClassVar

from pydantic import Field

from lapwing.cosim.config.run_config import ServiceConfig
from lapwing.cosim.scene import Scene, SceneTable
from lapwing.dynamics.lie.quaternion import NO_ROTATION
from lapwing.dynamics.validation import Table
from lapwing.dynamics.vector import ZERO
from lapwing.papers.quadrotor_os4 import Os4Motors, Os4Parameters, Os4State
from lapwing.services.common.ports import TrueState
from lapwing.services.common.schemas.run_schema import Triple
from lapwing.services.plant.models._common import autonomous, check_system, reject_other_tables, require_tables

RPM = 2.0 * math.pi / 60.0  # [rad/s]
Four = tuple[float, float, float, float]  # per rotor: front +x, left +y, rear -x, right -y


class Motors(Table):
    """Four equal motors."""

    voltage: Four = Field(strict=False)  # [V] of each motor
    constant: float = Field(gt=0.0)  # [N m/A] = [V s/rad], referred to the rotor's side of the gear
    resistance: float = Field(gt=0.0)  # [ohm] of a motor's winding


class Os4(SceneTable):
    """The quadrotor (theory, eqs. (7.11) to (7.14))."""

    TABLE: ClassVar[str] = "os4"
    OPTIONAL: ClassVar[bool] = True
    mass: float = Field(gt=0.0)  # [kg] of the vehicle
    inertia: Triple  # [kg m^2] about body x, y, z
    arm: float = Field(gt=0.0)  # [m] distance from the centre to a rotor
    lift_constant: float = Field(gt=0.0)  # [N s^2] thrust over the squared rotor speed
    drag_constant: float = Field(gt=0.0)  # [N m s^2] torque over the squared rotor speed
    rotor_inertia: float = Field(ge=0.0)  # [kg m^2] of one rotor about its axis
    gravity: float = 9.81  # [m/s^2] acceleration of free fall
    translational_drag: Triple = ZERO  # [N s/m] along the world axes
    rotor_speed_rpm: Four = Field(strict=False)  # [rpm] constant; with motors the initial speeds
    motors: Motors | None = None  # without motors the rotor speeds are constant


def check(scene: Scene) -> None:
    """Check that the scene describes the quadrotor and has no table that it cannot use."""
    require_tables(scene, "os4")
    reject_other_tables(scene)
    check_system(scene, *system(scene))


def resolve(scene: Scene) -> ServiceConfig:
    """Return the configuration of the quadrotor's plant."""
    four = (0.0,) * 4
    return autonomous(scene, *system(scene), TrueState(rotor_speed=four, rotor_thrust=four, rotor_torque=four))


def system(scene: Scene) -> tuple[Os4Parameters, Os4State]:
    """Return the parameters and the initial state."""
    q = scene[Os4]
    motors = Os4Motors(q.motors.voltage, q.motors.constant, q.motors.resistance) if q.motors else None
    p = Os4Parameters(
        q.mass, q.inertia, q.arm, q.lift_constant, q.drag_constant, q.rotor_inertia, q.gravity, q.translational_drag,
        motors,
    )  # fmt: skip
    first, second, third, fourth = q.rotor_speed_rpm
    speed = (first * RPM, second * RPM, third * RPM, fourth * RPM)
    return p, Os4State(ZERO, NO_ROTATION, ZERO, ZERO, speed)
