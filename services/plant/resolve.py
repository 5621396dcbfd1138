"""From a scene to the plant's set-up: by the model that `vehicle.model` names."""

import importlib

from cosim.scene import Scene
from cosim.setup import ServiceSetup
from services.common.vehicle import Vehicle
from services.plant.cores.multirotor import MultirotorPlant
from services.plant.models._common import noise_key


def resolve(scene: Scene) -> ServiceSetup:
    """The plant of the scene: every scene has one."""
    return importlib.import_module(f"services.plant.models.{scene[Vehicle].model}").resolve(scene)


def reseed(given: ServiceSetup, seed: int, vehicle: str) -> ServiceSetup:
    """The same plant with another seed; only a multirotor has random effects."""
    plant = given.parameters
    if not isinstance(plant.core, MultirotorPlant):
        return given
    core = plant.core._replace(key=noise_key(seed, vehicle))
    return given._replace(parameters=plant._replace(core=core))
