"""Multirotor that carries a load on a cable, with the effects and commands of `rigid_body`."""

from types import ModuleType
from typing import Any, ClassVar, NamedTuple

from pydantic import Field

from lapwing.cosim.config.run_config import ServiceConfig
from lapwing.cosim.diagram.compiled_block import CONTINUE, InputSample
from lapwing.cosim.scene import Scene, SceneTable
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.lie.quaternion import NO_ROTATION
from lapwing.dynamics.vector import Vec3
from lapwing.dynamics.vehicles import multirotor_slung
from lapwing.dynamics.vehicles.multirotor_equations import RotorLayout
from lapwing.dynamics.vehicles.multirotor_slung import Sling, cable_force
from lapwing.kernels import always_inline, math
from lapwing.services.common.ports import BodyMotions
from lapwing.services.common.schemas.environment_schema import environment
from lapwing.services.common.schemas.vehicle_schema import (
    Vehicle,
    VehicleAirframe,
    active,
    airframe,
    gravity,
    thrust_coefficient,
    wake_slopes,
)
from lapwing.services.plant.models import rigid_body
from lapwing.services.plant.models._common import bodies_port, multirotor_plant, require_tables
from lapwing.services.plant.schema import Solver


class SlungLoadView(NamedTuple):
    """Parameters of the block."""

    layout: RotorLayout


@always_inline
def step(p: SlungLoadView, s: Any, tick: int, inputs: tuple[InputSample, ...]) -> tuple[Any, tuple[BodyMotions], int]:
    """Output the motion of the load at `tick`, a point without rotation, and the force of the cable on it."""
    x, zero = s.vehicle.motion, ((0.0, 0.0, 0.0),)
    force = (cable_force(p.layout, x),)
    return s, (BodyMotions((x.load_position,), (NO_ROTATION,), (x.load_velocity,), zero, force, zero),), CONTINUE


NAME = "slung_load"
FASTEST = 1.0  # maximum cable frequency times step; methods of order 4 are then accurate to 1e-2 per period


class SlungLoad(SceneTable):
    """Cable and load, which the autopilot's vehicle model does not include."""

    TABLE: ClassVar[str] = NAME
    OPTIONAL: ClassVar[bool] = True
    mass: float = Field(gt=0.0)  # [kg] of the load, in addition to the vehicle's
    length: float = Field(gt=0.0)  # [m] of the cable without tension
    stiffness: float = Field(default=2000.0, gt=0.0)  # [N/m] of the cable
    damping_ratio: float = Field(default=0.1, ge=0.0, lt=2.0)  # ratio, of the load on the taut cable
    hook: Vec3 = Field(default=(0.0, 0.0, 0.0), strict=False)  # [m] body, attachment of the cable
    drag_area: float = Field(default=0.0, ge=0.0)  # [m^2] of the load, drag coefficient times area

    def check(self, scene: Scene) -> None:
        """Check that the vehicle can carry the load, and that the step is short enough for the cable."""
        if scene[Vehicle].model != NAME:
            raise ConfigError(NAME, f'the model {scene[Vehicle].model} has no such table; set vehicle.model = "{NAME}"')
        _check_weight(scene)
        fastest = multirotor_slung.frequency(_sling(scene), airframe(scene).mass.total)
        if scene[Solver].step * fastest > FASTEST:
            message = f"the load on the taut cable swings along it with {fastest:.0f} rad/s"
            raise ConfigError("solver.step", message, f"at most {FASTEST / fastest:.1g} s, or a softer cable")


def _check_weight(scene: Scene) -> None:
    """Check that the rotors lift vehicle and load."""
    frame, load = airframe(scene), scene[SlungLoad].mass
    fastest = frame.motor.max_voltage / frame.motor.rotor_constant
    shares = wake_slopes(scene).thrust
    count = sum(map(sum, shares)) if shares else len(frame.rotors.position)
    lift = count * thrust_coefficient(scene) * (fastest * fastest)
    weight = (frame.mass.total + load) * gravity(scene)
    if lift <= weight:
        message = f"got {load:g}: the rotors lift at most {lift:.0f} N, vehicle and load weigh {weight:.0f} N"
        raise ConfigError(f"{NAME}.mass", message, "a lighter load [kg]")


def _sling(scene: Scene) -> Sling:
    s = scene[SlungLoad]
    reduced_mass = 1.0 / (1.0 / s.mass + 1.0 / airframe(scene).mass.total)
    damping = 2.0 * s.damping_ratio * math.sqrt(s.stiffness * reduced_mass)
    hook = tuple(a - b for a, b in zip(s.hook, scene[VehicleAirframe].loaded.mass.centre, strict=True))
    return Sling(s.mass, s.length, s.stiffness, damping, hook, s.drag_area, environment(scene).terrain)  # type: ignore[arg-type]


def check(scene: Scene) -> None:
    """Check the rigid-body model's needs, and that the scene has a load."""
    require_tables(scene, NAME)
    rigid_body.check(scene)


def describe(scene: Scene) -> tuple[ModuleType, Any]:
    """Return the module of the formulation, and the parameters."""
    return multirotor_slung, multirotor_slung.parameters(airframe(scene), _sling(scene), active(scene))


def resolve(scene: Scene) -> ServiceConfig:
    """Return the configuration of a multirotor with its load, which is output as a body."""
    result = multirotor_plant(scene, *describe(scene))
    plant = result.parameters
    parameters = plant._replace(
        model=NAME, bodies=SlungLoadView(plant.core.vehicle.layout), encoding=plant.encoding._replace(bodies=("load",))
    )
    return result._replace(parameters=parameters, ports=(*result.ports, bodies_port(scene, 1)))
