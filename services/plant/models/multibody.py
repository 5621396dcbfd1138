"""A multirotor as five bodies: chassis and propellers on hinges, under the same effects and commands as `reduced`."""

import math
from collections.abc import Iterator
from types import ModuleType
from typing import Annotated, Any, ClassVar, Literal

from numba.extending import overload
from pydantic import BaseModel, ConfigDict, Field

from dynamics.cell import Cell, read
from dynamics.effects import _hooks as hooks
from dynamics.effects._types import Motion
from dynamics.kernel import kernel
from dynamics.multibody.five_bodies import FiveBodies
from dynamics.vehicles import multirotor_euler, multirotor_multibody
from dynamics.vehicles.multirotor import MultirotorDrive, MultirotorState
from messages import Actuators, Status
from messages.topics import BODIES, Topic
from services.lockstep import LockStepError
from services.plant import outputs
from services.plant.config import Solver
from services.plant.models import reduced
from services.scene import Scene, Section, WrongKeyError
from services.sections import Exchange, Run, Vehicle, active, airframe, period

NAMES = ("chassis", *[f"propeller{k + 1}" for k in range(4)])
LARGEST_TURN = 0.5  # [rad] of a propeller in a step of the redundant coordinates
FORM = {"se3": multirotor_multibody, "euler": multirotor_euler}


class Event(BaseModel):
    """What becomes of a propeller in flight, at the first tick that is not before `time`."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)
    time: float = Field(ge=0.0)  # [s]
    propeller: int = Field(ge=1, le=4)  # in the order of the airframe
    becomes: Literal["locked", "free", "torn_off"]


class Multibody(Section):
    """How the five bodies are described, held together and driven (theory.md, chapter 8), and what breaks in flight."""

    TABLE: ClassVar[str] = "multibody"
    OPTIONAL: ClassVar[bool] = True
    coordinates: Literal["se3", "euler"] = "se3"
    stabilisation: Literal["projection", "partitioning", "baumgarte", "none"] = "projection"
    drive: Literal["torque", "speed"] = "torque"
    event: Annotated[tuple[Event, ...], Field(strict=False)] = ()

    def check(self, scene: Scene) -> None:
        """The scene has bodies to describe, and time for the events, of which none follows on the loss of its part."""
        if scene[Vehicle].model != "multibody":
            raise WrongKeyError(
                "multibody", f'the model {scene[Vehicle].model} knows no such table; set vehicle.model = "multibody"'
            )
        duration, lost = scene[Run].duration, dict[int, float]()
        for i, event in sorted(enumerate(self.event), key=lambda item: item[1].time):
            if event.time > duration:
                raise ValueError(
                    f"event.{i}.time: expected a time within run.duration = {duration:g} s, got {event.time:g}"
                )
            if event.propeller in lost:
                raise ValueError(
                    f"event.{i}.propeller: propeller {event.propeller} is torn off at {lost[event.propeller]:g} s; "
                    "nothing can become of it after that"
                )
            if event.becomes == "torn_off":
                lost[event.propeller] = event.time


def _settings(scene: Scene) -> Multibody:
    return scene[Multibody] if scene.has(Multibody) else Multibody()


def check(scene: Scene) -> None:
    """As of the reduced model; the airframe tells of single rotors, which turn little in a step."""
    reduced.check(scene)
    try:
        multirotor_multibody.drone_of(airframe(scene))
    except ValueError as error:
        raise WrongKeyError("vehicle.airframe", f"{scene[Vehicle].airframe}: {error}") from None
    if scene[Solver].step > longest_step(scene):
        fastest, most = LARGEST_TURN / longest_step(scene), longest_step(scene)
        raise WrongKeyError("solver.step", f"propellers turn at up to {fastest:.0f} rad/s: take at most {most:.1g} s")


def longest_step(scene: Scene) -> float:
    """The step [s] in which no propeller turns further than LARGEST_TURN."""
    motor = airframe(scene).motor
    return LARGEST_TURN * motor.rotor_constant / motor.max_voltage


def described(scene: Scene) -> tuple[ModuleType, Any]:
    """As `reduced.described`."""
    s = _settings(scene)
    form = FORM[s.coordinates]
    return form, form.parameters(airframe(scene), active(scene), s.drive, s.stabilisation)


def _tick(scene: Scene, time: float) -> int:
    return math.ceil(round(time * scene[Exchange].rate, 6))


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


def struck(drive, x):
    """The bodies after impulses in their hinges, in whichever coordinates they are."""
    raise NotImplementedError("compiled code only")


@overload(struck)
def _struck(drive, x):
    found = multirotor_multibody.struck if x.instance_class is FiveBodies else multirotor_euler.struck
    return lambda drive, x: found(drive, x)


@kernel
def lock(p, s, command):
    """Meet the constraints of parameters p at once in the state of the cell `s`, under a command [V]."""
    g, memory = p.value, s.value.memory
    drive = MultirotorDrive(g, hooks.all_body(g.effects, memory, g.body), memory, command)
    s.value = MultirotorState(struck(drive, s.value.motion), memory)


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
    described = staticmethod(described)

    def __init__(self, scene: Scene):
        super().__init__(scene)
        self._bodies_every, self._form = period(scene, BODIES), FORM[_settings(scene).coordinates]
        self._events: dict[int, list[Event]] = {}
        for event in _settings(scene).event:
            self._events.setdefault(_tick(scene, event.time), []).append(event)

    def prepare(self) -> None:
        """Compile or load the kernels."""
        super().prepare()
        bodies(self._parameters, self._state, 0, self._off, self._interval)
        if self._events:  # of a kind that may come after minutes of flight
            lock(self._parameters, Cell(read(self._state)), self._off)

    def _fly(self, tick: int, command: tuple, steps: int) -> Any:
        # what happens at a tick happens after that tick's state was told
        for event in self._events.get(tick - 1, ()) if steps else ():
            self._parameters = Cell(self._form.after(read(self._parameters), event.propeller - 1, event.becomes))
            if event.becomes == "locked":
                lock(self._parameters, self._state, command)
        return super()._fly(tick, command, steps)

    def step(self, tick: int, actuators: Actuators | None, status: Status | None) -> Iterator[tuple[Topic, Any]]:
        """Advance to `tick`, as the reduced model does."""
        try:
            yield from super().step(tick, actuators, status)
        except LockStepError:
            x = read(self._state).motion
            body = multirotor_euler.singular(x) if self._form is multirotor_euler else -1
            if body < 0:
                raise
            raise LockStepError(
                f"the multirotor: {NAMES[body]}: pitch reached 90 degrees by t = {tick * self._interval:g} s, where "
                'Euler angles end; multibody.coordinates = "se3" has no such place'
            ) from None
        if tick % self._bodies_every == 0:
            command = actuators.motor_voltage if actuators else self._off
            x, joints = bodies(self._parameters, self._state, tick, command, self._interval)
            parts: list[Any] = [x.chassis, *x.propellers]
            motions = [Motion(b.position_world, b.attitude, b.velocity_world, b.omega_body, ()) for b in parts]
            forces, torques = zip(*joints, strict=True)
            yield BODIES, outputs.bodies(tick * self._interval_ns, NAMES, motions, forces, torques)
