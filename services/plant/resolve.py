"""From a scene to the plant's set-up: by the model that `vehicle.model` names."""

import importlib
from collections.abc import Mapping

from cosim.scene import Scene
from cosim.setup import ServiceSetup
from dynamics.effects.carried_load import CarriedLoad
from dynamics.errors import KeyedError
from services.common import ports
from services.common.vehicle import Vehicle
from services.plant import interactions
from services.plant.cores.multirotor import MultirotorPlant
from services.plant.models._common import bodies_port, noise_key


def resolve(scene: Scene) -> ServiceSetup:
    """The plant of the scene: every scene has one."""
    model = scene[Vehicle].model
    found = importlib.import_module(f"services.plant.models.{model}").resolve(scene)
    if any(isinstance(e, CarriedLoad) for e in interactions.effects_of(found)):
        if any(port.name == ports.BODIES for port in found.ports):
            raise KeyedError("effects.carried_load", f"the model {model} tells of bodies of its own", "another model")
        plant = found.parameters
        parameters = plant._replace(wiring=plant.wiring._replace(bodies=("load",)))
        return ServiceSetup(parameters, found.inputs, (*found.ports, bodies_port(scene, 1)))
    return found


def fleet(shares: Mapping[str, ServiceSetup], keys: Mapping[str, str]) -> dict[str, ServiceSetup]:
    """The plants of a run's vehicles, by their names, once they know of one another; as of `interactions.told`."""
    return interactions.told(shares, keys)


def reseed(given: ServiceSetup, seed: int, vehicle: str) -> ServiceSetup:
    """The same plant with another seed; only a multirotor has random effects."""
    plant = given.parameters
    if not isinstance(plant.core, MultirotorPlant):
        return given
    core = plant.core._replace(key=noise_key(seed, vehicle))
    return given._replace(parameters=plant._replace(core=core))
