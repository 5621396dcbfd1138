"""Multirotor of one rigid body with rotors: motor voltages in, true state out."""

from types import ModuleType
from typing import Any

from lapwing.cosim.config.run_config import ServiceConfig
from lapwing.cosim.scene import Scene
from lapwing.dynamics.vehicles import multirotor
from lapwing.services.common.firmware.schema import flown_by_firmware
from lapwing.services.common.schemas.vehicle_schema import active, airframe
from lapwing.services.plant.models._common import check_integrator, multirotor_plant, require_tables


def check(scene: Scene) -> None:
    """Raise ConfigError for an invalid airframe, a missing autopilot or an unsuitable integrator."""
    airframe(scene)
    require_tables(scene, "autopilot")
    if not scene.lookup("autopilot.accept_commands") and not flown_by_firmware(scene):
        require_tables(scene, "trajectory")
    p = multirotor.parameters(airframe(scene))
    check_integrator(scene, p, multirotor.initial_state(p).motion)


def describe(scene: Scene) -> tuple[ModuleType, Any]:
    """Return the module of the formulation, and the parameters."""
    return multirotor, multirotor.parameters(airframe(scene), active(scene))


def resolve(scene: Scene) -> ServiceConfig:
    """Return the configuration of a multirotor as one rigid body."""
    return multirotor_plant(scene, *describe(scene))
