"""From a scene to the plant's set-up: by the model that `vehicle.model` names."""

import importlib
from collections.abc import Mapping

from lapwing.cosim.config.run_config import ServiceConfig
from lapwing.cosim.diagram.tick_schedule import Port
from lapwing.cosim.scene import Scene
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.effects._contact_parameters import GroundContact, GroundContactSmooth
from lapwing.dynamics.effects.shared_slung_load import SharedSlungLoad
from lapwing.dynamics.vector import ZERO
from lapwing.services.common import ports
from lapwing.services.common.communication_schema import Rates
from lapwing.services.common.ports import ContactForces
from lapwing.services.common.vehicle_schema import Vehicle
from lapwing.services.plant import fleet_coupling
from lapwing.services.plant.blocks.contact import ContactView
from lapwing.services.plant.blocks.multirotor import MultirotorPlant
from lapwing.services.plant.models._common import bodies_port, noise_key, rate_ticks


def resolve(scene: Scene) -> ServiceConfig:
    """The plant of the scene: every scene has one."""
    model = scene[Vehicle].model
    found = importlib.import_module(f"lapwing.services.plant.models.{model}").resolve(scene)
    if scene[Rates].contact_forces is not None:
        found = _with_contact(scene, found)
    if any(isinstance(e, SharedSlungLoad) for e in fleet_coupling.effects_of(found)):
        if any(port.name == ports.BODIES for port in found.ports):
            raise ConfigError(
                "effects.shared_slung_load", f"the model {model} tells of bodies of its own", "another model"
            )
        plant = found.parameters
        parameters = plant._replace(wiring=plant.wiring._replace(bodies=("load",)))
        return ServiceConfig(parameters, found.inputs, (*found.ports, bodies_port(scene, 1)))
    return found


def _with_contact(scene: Scene, found: ServiceConfig) -> ServiceConfig:
    """The same plant, which also tells of the forces on its feet."""
    effect = next(
        (e for e in fleet_coupling.effects_of(found) if isinstance(e, GroundContact | GroundContactSmooth)), None
    )
    if effect is None:
        message = "no effect of the scene tells of forces on feet"
        raise ConfigError(
            "rates.contact_forces", message, "a multirotor with [effects.ground_contact], or to leave it out"
        )
    plant, zero = found.parameters, (ZERO,) * len(effect.feet)
    port = Port(ports.CONTACT, ContactForces(zero, zero), rate_ticks(scene, "contact_forces"))
    return ServiceConfig(plant._replace(contact=ContactView(plant.core.vehicle)), found.inputs, (*found.ports, port))


def fleet(shares: Mapping[str, ServiceConfig], keys: Mapping[str, str]) -> dict[str, ServiceConfig]:
    """The plants of a run's vehicles, by their names, once they know of one another; as of `interactions.told`."""
    return fleet_coupling.told(shares, keys)


def reseed(given: ServiceConfig, seed: int, vehicle: str) -> ServiceConfig:
    """The same plant with another seed; only a multirotor has random effects."""
    plant = given.parameters
    if not isinstance(plant.core, MultirotorPlant):
        return given
    core = plant.core._replace(key=noise_key(seed, vehicle))
    return given._replace(parameters=plant._replace(core=core))
