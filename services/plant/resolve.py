"""From a scene to the plant's set-up: by the model that `vehicle.model` names."""

import importlib
from collections.abc import Mapping

from cosim.scene import Scene
from cosim.setup import ServiceSetup
from dynamics.effects._interaction import interacts, presence
from services.common.vehicle import Vehicle
from services.plant.cores.multirotor import MultirotorPlant
from services.plant.models._common import noise_key
from services.plant.setup import Others


def resolve(scene: Scene) -> ServiceSetup:
    """The plant of the scene: every scene has one."""
    return importlib.import_module(f"services.plant.models.{scene[Vehicle].model}").resolve(scene)


def fleet(shares: Mapping[str, ServiceSetup], keys: Mapping[str, str]) -> dict[str, ServiceSetup]:
    """The plants of a run's vehicles, by their names: whose effects know of others are told who else has such."""
    having = [name for name, given in shares.items() if interacts(_effects(given))]
    found = dict(shares)
    for name in having:
        plant, others = shares[name].parameters, tuple(other for other in having if other != name)
        if others:
            told = Others(others, presence(_effects(shares[name])))
            found[name] = shares[name]._replace(parameters=plant._replace(others=told))
    return found


def _effects(given: ServiceSetup) -> tuple:
    core = given.parameters.core
    return core.vehicle.effects if isinstance(core, MultirotorPlant) else ()


def reseed(given: ServiceSetup, seed: int, vehicle: str) -> ServiceSetup:
    """The same plant with another seed; only a multirotor has random effects."""
    plant = given.parameters
    if not isinstance(plant.core, MultirotorPlant):
        return given
    core = plant.core._replace(key=noise_key(seed, vehicle))
    return given._replace(parameters=plant._replace(core=core))
