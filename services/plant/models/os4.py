"""The OS4 quadrotor with rotors at given speeds, or turned by motors at given voltages: nobody steers it."""

import math
from collections.abc import Iterator
from typing import Any, ClassVar

from pydantic import BaseModel, ConfigDict, Field

from dynamics.effects._types import Motion
from dynamics.integrators import rate
from dynamics.kernel import kernel
from dynamics.lie.quaternion import NO_ROTATION
from dynamics.vehicles.quadrotor_os4 import Os4Motors, Os4Parameters, Os4State
from messages import Vector3, VehicleState, header
from messages.topics import CLOCK, POSE, TF, TRUTH, Topic
from services.plant import outputs
from services.plant.ending import Ending
from services.plant.marched import Marched, check_marched
from services.scene import Scene, Section
from services.sections import Exchange, Triple, Vehicle, can_have, needs, period

NOTHING = (0.0, 0.0, 0.0)
RPM = 2.0 * math.pi / 60.0  # [rad/s]
Four = tuple[float, float, float, float]  # one for each rotor: front +x, left +y, rear -x, right -y


class Motors(BaseModel):
    """Motors of one kind."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)
    voltage: Four = Field(strict=False)  # [V]
    constant: float = Field(gt=0.0)  # [N m/A] = [V s/rad], referred to the rotor's side of the gear
    resistance: float = Field(gt=0.0)  # [ohm]


class Os4(Section):
    """The quadrotor (theory.md, eqs. (7.11) to (7.14))."""

    TABLE: ClassVar[str] = "os4"
    OPTIONAL: ClassVar[bool] = True
    mass: float = Field(gt=0.0)  # [kg]
    inertia: Triple  # [kg m^2]
    arm: float = Field(gt=0.0)  # [m]
    lift_constant: float = Field(gt=0.0)  # [N s^2]
    drag_constant: float = Field(gt=0.0)  # [N m s^2]
    rotor_inertia: float = Field(ge=0.0)  # [kg m^2]
    gravity: float = 9.81  # [m/s^2]
    translational_drag: Triple = NOTHING  # [N s/m] along the world axes
    rotor_speed_rpm: Four = Field(strict=False)  # kept, or with motors the start
    motors: Motors | None = None


def check(scene: Scene) -> None:
    """The quadrotor is described, and nothing asks of it what it cannot do."""
    needs(scene, "os4")
    can_have(scene)
    check_marched(scene, *_system(scene))


def create(scene: Scene) -> "OpenLoop":
    """The plant of the quadrotor."""
    return OpenLoop(scene)


def _system(scene: Scene) -> tuple[Os4Parameters, Os4State]:
    q = scene[Os4]
    motors = Os4Motors(q.motors.voltage, q.motors.constant, q.motors.resistance) if q.motors else None
    p = Os4Parameters(
        q.mass, q.inertia, q.arm, q.lift_constant, q.drag_constant, q.rotor_inertia, q.gravity, q.translational_drag,
        motors,
    )  # fmt: skip
    first, second, third, fourth = q.rotor_speed_rpm
    speed = (first * RPM, second * RPM, third * RPM, fourth * RPM)
    return p, Os4State(NOTHING, NO_ROTATION, NOTHING, NOTHING, speed)


@kernel
def acceleration(p, t, x):
    """Acceleration of the centre of mass in the world [m/s^2]."""
    return rate(p.value, t, x).velocity_world


class OpenLoop:
    """Flies from rest at the origin as its rotors have it."""

    inputs = ()
    outputs = (TRUTH, POSE, TF, CLOCK)

    def __init__(self, scene: Scene):
        self.finished = False
        self._end = Ending(scene)
        exchange = scene[Exchange]
        self._name, self._interval, self._interval_ns = scene[Vehicle].name, exchange.interval, exchange.interval_ns
        self._pose_every = period(scene, POSE)
        self._lift_constant, self._drag_constant = scene[Os4].lift_constant, scene[Os4].drag_constant
        self._marched = Marched(scene, *_system(scene))

    def prepare(self) -> None:
        """Compile or load the kernels."""
        acceleration(self._marched.parameters, 0.0, self._marched.to(0))

    def step(self, tick: int) -> Iterator[tuple[Topic, Any]]:
        """Advance to `tick`."""
        state = self._marched.to(tick)
        self.finished = self._end.reached(tick)
        time_ns = tick * self._interval_ns
        motion = Motion(*state)
        yield (
            TRUTH,
            VehicleState(
                header(time_ns, outputs.WORLD),
                outputs.pose_of(motion),
                Vector3(*state.velocity_world),
                Vector3(*state.omega_body),
                Vector3(*acceleration(self._marched.parameters, tick * self._interval, state)),
                rotor_speed=state.rotor_speed,
                rotor_thrust=tuple(self._lift_constant * w * w for w in state.rotor_speed),
                rotor_torque=tuple(self._drag_constant * w * w for w in state.rotor_speed),
            ),
        )
        if tick % self._pose_every == 0:
            yield from outputs.whereabouts(time_ns, self._name, motion)
