"""A multirotor as five bodies: chassis and propellers on hinges, under the same effects and commands as `reduced`."""

from collections.abc import Iterator
from typing import Any, ClassVar, Literal

from numba.extending import overload

from dynamics.effects import _hooks as hooks
from dynamics.effects._types import Motion
from dynamics.kernel import kernel
from dynamics.multibody.five_bodies import FiveBodies
from dynamics.vehicles import multirotor_euler, multirotor_multibody
from dynamics.vehicles.multirotor import MultirotorDrive
from messages import Actuators, Status
from messages.topics import BODIES, Topic
from services.lockstep import LockStepError
from services.plant import outputs
from services.plant.config import Solver
from services.plant.models import reduced
from services.scene import Scene, Section, WrongKeyError
from services.sections import Vehicle, active, airframe, period, start_height

NAMES = ("chassis", *[f"propeller{k + 1}" for k in range(4)])
LARGEST_TURN = 0.5  # [rad] of a propeller in a step of the redundant coordinates
FORM = {"se3": multirotor_multibody, "euler": multirotor_euler}


class Multibody(Section):
    """How the five bodies are described, held together and driven (theory.md, chapter 8)."""

    TABLE: ClassVar[str] = "multibody"
    OPTIONAL: ClassVar[bool] = True
    coordinates: Literal["se3", "euler"] = "se3"
    stabilisation: Literal["projection", "partitioning", "baumgarte", "none"] = "projection"
    drive: Literal["torque", "speed"] = "torque"

    def check(self, scene: Scene) -> None:
        """The scene has bodies to describe."""
        if scene[Vehicle].model != "multibody":
            raise ValueError(f'the model {scene[Vehicle].model} knows no such table; set vehicle.model = "multibody"')


def _settings(scene: Scene) -> Multibody:
    return scene[Multibody] if scene.has(Multibody) else Multibody()


def check(scene: Scene) -> None:
    """As of the reduced model; the airframe tells of single rotors, which turn little in a step."""
    reduced.check(scene)
    frame = airframe(scene)
    try:
        multirotor_multibody.drone_of(frame)
    except ValueError as error:
        raise WrongKeyError("vehicle.airframe", f"{scene[Vehicle].airframe}: {error}") from None
    fastest = frame.motor.max_voltage / frame.motor.rotor_constant
    if scene[Solver].step * fastest > LARGEST_TURN:
        most = LARGEST_TURN / fastest
        raise WrongKeyError("solver.step", f"propellers turn at up to {fastest:.0f} rad/s: take at most {most:.1g} s")


def create(scene: Scene) -> "FiveBodyPlant":
    """The plant of a multirotor of five bodies."""
    return FiveBodyPlant(scene)


def on_se3(x):
    """The bodies' poses, in whichever coordinates they are."""
    raise NotImplementedError("compiled code only")


@overload(on_se3)
def _on_se3(x):
    if x.instance_class is FiveBodies:
        return lambda x: x
    return lambda x: multirotor_euler.five(x)


@kernel
def bodies(p, s, tick, command, interval):
    """(bodies on SE(3), joints) of the state in the cell `s` at `tick` under a command [V]."""
    g, memory = p.value, s.value.memory
    x = on_se3(s.value.motion)
    drive = MultirotorDrive(g, hooks.all_body(g.effects, memory, g.body), memory, command)
    return x, multirotor_multibody.joints(drive, tick * interval, x)


class FiveBodyPlant(reduced.Reduced):
    """Tells of single bodies as well: forces and torques of the hinges, a drive's torque along its propeller's axis."""

    outputs = (*reduced.Reduced.outputs, BODIES)  # type: ignore[assignment]

    def __init__(self, scene: Scene):
        super().__init__(scene)
        self._bodies_every, self._coordinates = period(scene, BODIES), _settings(scene).coordinates

    def _vehicle(self, scene: Scene) -> tuple[Any, Any]:
        s = _settings(scene)
        p = FORM[s.coordinates].parameters(airframe(scene), active(scene), s.drive, s.stabilisation)
        return p, FORM[s.coordinates].initial_state(p, (0.0, 0.0, start_height(scene)))

    def prepare(self) -> None:
        """Compile or load the kernels."""
        super().prepare()
        bodies(self._parameters, self._state, 0, self._off, self._interval)

    def step(self, tick: int, actuators: Actuators | None, status: Status | None) -> Iterator[tuple[Topic, Any]]:
        """Advance to `tick`, as the reduced model does."""
        try:
            yield from super().step(tick, actuators, status)
        except LockStepError as error:
            if self._coordinates == "euler":
                raise LockStepError(
                    f'{error}; Euler angles end at 90 degrees: multibody.coordinates = "se3" has no such place'
                ) from None
            raise
        if tick % self._bodies_every == 0:
            command = actuators.motor_voltage if actuators else self._off
            x, joints = bodies(self._parameters, self._state, tick, command, self._interval)
            parts: list[Any] = [x.chassis, *x.propellers]
            motions = [Motion(b.position_world, b.attitude, b.velocity_world, b.omega_body, ()) for b in parts]
            forces, torques = zip(*joints, strict=True)
            yield BODIES, outputs.bodies(tick * self._interval_ns, NAMES, motions, forces, torques)
