"""A multirotor as one rigid body with rotors: motor voltages in, the vehicle's true state out."""

from types import ModuleType
from typing import Any

from lapwing.cosim.config.run_config import ServiceConfig
from lapwing.cosim.scene import Scene
from lapwing.dynamics.vehicles import multirotor
from lapwing.services.common.vehicle_schema import active, airframe
from lapwing.services.plant.models._common import check_integrator, multirotor_plant, needs


def check(scene: Scene) -> None:
    """KeyedError where the airframe's file is missing or unsound, nobody flies it, or the integrator does not fit."""
    airframe(scene)
    needs(scene, "autopilot")
    if not scene.lookup("autopilot.accept_commands"):
        needs(scene, "trajectory")
    p = multirotor.parameters(airframe(scene))
    check_integrator(scene, p, multirotor.initial_state(p).motion)


def described(scene: Scene) -> tuple[ModuleType, Any]:
    """(module that makes the states, parameters)."""
    return multirotor, multirotor.parameters(airframe(scene), active(scene))


def resolve(scene: Scene) -> ServiceConfig:
    """The plant of a multirotor as one rigid body."""
    return multirotor_plant(scene, *described(scene))
