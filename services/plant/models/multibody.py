"""Multirotor of five bodies, chassis and propellers on hinges, with the effects and commands of `rigid_body`."""

import math
from collections.abc import Callable
from types import ModuleType
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

from numba import types
from pydantic import Field

from lapwing.cosim.config.run_config import ServiceConfig
from lapwing.cosim.diagram.compiled_block import CONTINUE, InputSample
from lapwing.cosim.scene import Scene, SceneTable
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.effects import _hooks as hooks
from lapwing.dynamics.multibody.five_bodies import FiveBodies
from lapwing.dynamics.validation import Table
from lapwing.dynamics.vehicles import multirotor_euler, multirotor_multibody
from lapwing.dynamics.vehicles.multirotor_equations import MultirotorParameters, StepInputs
from lapwing.dynamics.vehicles.multirotor_multibody_equations import joints
from lapwing.dynamics.vehicles.multirotor_stepper import BREAK_ROUNDING
from lapwing.kernels import always_inline
from lapwing.kernels.codegen import generic
from lapwing.services.common.ports import BodyMotions, PerRotor
from lapwing.services.common.schemas.communication_schema import Communication
from lapwing.services.common.schemas.run_schema import Run
from lapwing.services.common.schemas.vehicle_schema import Vehicle, active, airframe
from lapwing.services.plant.models import rigid_body
from lapwing.services.plant.models._common import bodies_port, multirotor_plant
from lapwing.services.plant.schema import Solver
from lapwing.services.plant.service_config import PlantEvent


class FiveBodiesView(NamedTuple):
    """Parameters of the block."""

    vehicle: MultirotorParameters
    interval: float  # [s] length of a tick
    off: PerRotor  # [V] before the first command


@generic()
def on_se3(x: types.Type) -> Callable:
    """Return the bodies' poses on SE(3), from any coordinates."""
    if x.instance_class is FiveBodies:
        return lambda x: x
    return lambda x: multirotor_euler.five(x)


@always_inline
def step(p: FiveBodiesView, s: Any, tick: int, inputs: tuple[InputSample, ...]) -> tuple[Any, tuple[BodyMotions], int]:
    """Output the motions of the bodies at `tick`, and the loads of their hinges under the command of the tick."""
    actuators = inputs[0]
    command = actuators.value.motor_voltage if actuators.due else p.off
    g, memory = p.vehicle, s.vehicle.memory
    u = StepInputs(g, hooks.all_mass_properties(g.effects, memory, g.body), memory, command)
    x = on_se3(s.vehicle.motion)
    j = joints(u, tick * p.interval, x)
    a, (b, c, d, e) = x.chassis, x.propellers
    sample = BodyMotions(
        (a.position_world, b.position_world, c.position_world, d.position_world, e.position_world),
        (a.attitude, b.attitude, c.attitude, d.attitude, e.attitude),
        (a.velocity_world, b.velocity_world, c.velocity_world, d.velocity_world, e.velocity_world),
        (a.omega_body, b.omega_body, c.omega_body, d.omega_body, e.omega_body),
        (j[0][0], j[1][0], j[2][0], j[3][0], j[4][0]),
        (j[0][1], j[1][1], j[2][1], j[3][1], j[4][1]),
    )
    return s, (sample,), CONTINUE


NAMES = ("chassis", *[f"propeller{k + 1}" for k in range(4)])
LARGEST_TURN = 0.5  # [rad] of a propeller in a step of the redundant coordinates
FORMULATIONS = {"se3": multirotor_multibody, "euler": multirotor_euler}


class Event(Table):
    """Failure of a propeller in flight, at `time`."""

    time: float = Field(ge=0.0)  # [s] moment of the failure
    propeller: int = Field(ge=1, le=4)  # in the order of the airframe
    failure: Literal["locked", "free", "torn_off"]  # locked to the chassis, disconnected from its motor, or torn off


class Multibody(SceneTable):
    """Formulation of the five bodies, their constraints, drives and failures (theory, chapter 8)."""

    TABLE: ClassVar[str] = "multibody"
    OPTIONAL: ClassVar[bool] = True
    coordinates: Literal["se3", "euler"] = "se3"  # a pose in SE(3) for each body, or positions and Euler angles
    stabilisation: Literal["projection", "partitioning", "baumgarte", "none"] = "projection"  # for constraints
    drive: Literal["torque", "speed"] = "torque"  # motors apply a torque, or prescribe the rotor speed
    event: Annotated[tuple[Event, ...], Field(strict=False)] = ()  # propeller failures in flight

    def check(self, scene: Scene) -> None:
        """Check that the model has five bodies, and that no event affects a lost part or lies after the run."""
        if scene[Vehicle].model != "multibody":
            raise ConfigError(
                "multibody", f'the model {scene[Vehicle].model} has no such table; set vehicle.model = "multibody"'
            )
        duration, lost = scene[Run].duration, dict[int, float]()
        for i, event in sorted(enumerate(self.event), key=lambda item: item[1].time):
            if event.time > duration:
                expected = f"a time within run.duration = {duration:g} s"
                raise ConfigError(f"multibody.event.{i}.time", f"got {event.time:g}", expected)
            if event.propeller in lost:
                message = (
                    f"propeller {event.propeller} is torn off at {lost[event.propeller]:g} s and cannot fail again"
                )
                raise ConfigError(f"multibody.event.{i}.propeller", message)
            if event.failure == "torn_off":
                lost[event.propeller] = event.time


def _settings(scene: Scene) -> Multibody:
    return scene[Multibody] if scene.has(Multibody) else Multibody()


def check(scene: Scene) -> None:
    """Check the rigid-body model's needs, single rotors in the airframe, and a step short enough for them."""
    rigid_body.check(scene)
    try:
        multirotor_multibody.drone_of(airframe(scene))
    except ValueError as error:
        raise ConfigError("vehicle.airframe", f"{scene[Vehicle].airframe}: {error}") from None
    if scene[Solver].step > longest_step(scene):
        fastest, most = LARGEST_TURN / longest_step(scene), longest_step(scene)
        raise ConfigError("solver.step", f"propellers turn at up to {fastest:.0f} rad/s", f"at most {most:.1g} s")


def longest_step(scene: Scene) -> float:
    """Return the longest step [s] in which no propeller turns further than LARGEST_TURN."""
    motor = airframe(scene).motor
    return LARGEST_TURN * motor.rotor_constant / motor.max_voltage


def describe(scene: Scene) -> tuple[ModuleType, Any]:
    """Return the module of the formulation, and the parameters."""
    s = _settings(scene)
    formulation = FORMULATIONS[s.coordinates]
    return formulation, formulation.parameters(airframe(scene), active(scene), s.drive, s.stabilisation)


def _event(scene: Scene, event: Event) -> PlantEvent:
    tick = math.floor(event.time * scene[Communication].rate + BREAK_ROUNDING)
    return PlantEvent(tick, event.propeller - 1, event.failure, event.time)


def resolve(scene: Scene) -> ServiceConfig:
    """Return the configuration of a multirotor of five bodies, with its failures."""
    formulation, p = describe(scene)
    result = multirotor_plant(scene, formulation, p)
    events = tuple(_event(scene, event) for event in sorted(_settings(scene).event, key=lambda event: event.time))
    plant = result.parameters
    view = FiveBodiesView(p, plant.core.interval, plant.core.off)
    parameters = plant._replace(
        model="multibody",
        bodies=view,
        events=events,
        euler=formulation is multirotor_euler,
        encoding=plant.encoding._replace(bodies=NAMES),
    )
    return result._replace(parameters=parameters, ports=(*result.ports, bodies_port(scene, len(NAMES))))
