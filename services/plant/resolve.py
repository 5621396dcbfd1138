"""Resolution of a scene into the plant's configuration, by the model of `vehicle.model`."""

from collections.abc import Mapping
from typing import Any, NamedTuple

from lapwing.cosim.config.run_config import ServiceConfig
from lapwing.cosim.diagram.compiled_block import CONTINUE, InputSample
from lapwing.cosim.diagram.tick_schedule import Port
from lapwing.cosim.scene import Scene
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.effects import _hooks as hooks
from lapwing.dynamics.effects._contact_parameters import GroundContact, GroundContactSmooth
from lapwing.dynamics.effects.shared_slung_load import SharedSlungLoad
from lapwing.dynamics.vector import ZERO, first, second
from lapwing.dynamics.vehicles.multirotor_equations import MultirotorParameters, motion_of
from lapwing.kernels import always_inline
from lapwing.kernels.codegen import map_tuple
from lapwing.services.common import ports
from lapwing.services.common.ports import ContactForces
from lapwing.services.common.schemas.communication_schema import Rates
from lapwing.services.common.schemas.vehicle_schema import Vehicle
from lapwing.services.plant import fleet_coupling, models
from lapwing.services.plant.blocks.multirotor import MultirotorPlant
from lapwing.services.plant.models._common import bodies_port, noise_key, rate_ticks


class ContactView(NamedTuple):
    """Parameters of the block."""

    vehicle: MultirotorParameters


@always_inline
def step(p: ContactView, s: Any, tick: int, inputs: tuple[InputSample, ...]) -> tuple[Any, tuple[ContactForces], int]:
    """Output position and ground force of each contact point at `tick`."""
    vehicle, state = p.vehicle, s.vehicle
    pushes = hooks.all_contact_forces(vehicle.effects, state.memory, motion_of(vehicle.layout, state.motion))
    return s, (ContactForces(map_tuple(first, 0.0, pushes, pushes), map_tuple(second, 0.0, pushes, pushes)),), CONTINUE


def resolve(scene: Scene) -> ServiceConfig:
    """Return the configuration of the plant; every scene has one."""
    model = scene[Vehicle].model
    result = models.get(model).resolve(scene)
    if scene[Rates].contact_forces is not None:
        result = _with_contact(scene, result)
    if any(isinstance(e, SharedSlungLoad) for e in fleet_coupling.effects_of(result)):
        if any(port.name == ports.BODIES for port in result.ports):
            raise ConfigError(
                "effects.shared_slung_load", f"the model {model} publishes its own bodies", "another model"
            )
        plant = result.parameters
        parameters = plant._replace(encoding=plant.encoding._replace(bodies=("load",)))
        return ServiceConfig(parameters, result.inputs, (*result.ports, bodies_port(scene, 1)))
    return result


def _with_contact(scene: Scene, config: ServiceConfig) -> ServiceConfig:
    """Return the plant with the output of its contact forces."""
    effect = next(
        (e for e in fleet_coupling.effects_of(config) if isinstance(e, GroundContact | GroundContactSmooth)), None
    )
    if effect is None:
        message = "no effect of the scene computes contact forces"
        raise ConfigError(
            "rates.contact_forces", message, "a multirotor with [effects.ground_contact], or no such rate"
        )
    plant, zero = config.parameters, (ZERO,) * len(effect.feet)
    port = Port(ports.CONTACT, ContactForces(zero, zero), rate_ticks(scene, "contact_forces"))
    return ServiceConfig(plant._replace(contact=ContactView(plant.core.vehicle)), config.inputs, (*config.ports, port))


def fleet(
    shares: Mapping[str, ServiceConfig], keys: Mapping[str, str], scenes: Mapping[str, Scene]
) -> dict[str, ServiceConfig]:
    """Return the plants by vehicle name, coupled to each other.

    Args:
        shares: configuration of each vehicle with this service, by vehicle name.
        keys: prefix of each vehicle's scene keys.
        scenes: scene of each vehicle of the fleet, with and without this service.

    Raises:
        ConfigError: see `fleet_coupling.couple`.
    """
    return fleet_coupling.couple(shares, keys)


def reseed(config: ServiceConfig, seed: int, vehicle: str) -> ServiceConfig:
    """Return the plant with another seed; only a multirotor has random effects."""
    plant = config.parameters
    if not isinstance(plant.core, MultirotorPlant):
        return config
    core = plant.core._replace(key=noise_key(seed, vehicle))
    return config._replace(parameters=plant._replace(core=core))
