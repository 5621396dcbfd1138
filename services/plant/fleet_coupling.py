"""Coupling of the plants of a fleet: neighbours of each vehicle, and integration of a shared load."""

from collections.abc import Mapping
from itertools import combinations
from typing import Any

from lapwing.cosim.config.run_config import ServiceConfig
from lapwing.cosim.diagram.multi_vehicle import neighbour_port
from lapwing.dynamics import integrators
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.effects import _hooks as hooks
from lapwing.dynamics.effects._vehicle_interaction import interacts, presence
from lapwing.dynamics.effects.collision import Collision
from lapwing.dynamics.effects.shared_slung_load import SharedSlungLoad
from lapwing.dynamics.lie.quaternion import rotate
from lapwing.dynamics.terrain import surface
from lapwing.dynamics.vector import ZERO, Vec3, add, norm, subtract
from lapwing.dynamics.vehicles.multirotor_slung import Sling, frequency
from lapwing.kernels import math
from lapwing.services.common import ports
from lapwing.services.plant.blocks.carried_load import LoadMotion, LoadPlant
from lapwing.services.plant.blocks.multirotor import MultirotorPlant
from lapwing.services.plant.service_config import FleetCoupling, PlantConfig

PRESENCE, LOAD = "presence", "load"  # ports exchanged between the plants of a fleet
FASTEST = 0.5  # maximum cable frequency times communication step; the predicted load is then within 2 %


def couple(shares: Mapping[str, ServiceConfig], keys: Mapping[str, str]) -> dict[str, ServiceConfig]:
    """Return the configurations of all plants, each with the neighbours of its interacting effects.

    Args:
        shares: configuration by vehicle name.
        keys: prefix of each vehicle's scene keys.

    Raises:
        ConfigError: vehicles touch at the start, disagree on their load, or cannot reach it.
    """
    _check_separation(shares, keys)
    interacting = [name for name, config in shares.items() if interacts(effects_of(config))]
    carriers = {name: sling for name in interacting if (sling := _sling(shares[name]))}
    owner = next(iter(carriers), "")
    result = dict(shares)
    for name in interacting:
        neighbours = [neighbour_port(other, PRESENCE) for other in interacting if other != name]
        load: dict[str, Any] = {}
        if name in carriers:
            neighbours.append(LOAD if name == owner else neighbour_port(owner, LOAD))
        if name == owner:
            load = _load(shares, carriers, keys)
        if neighbours:
            plant: PlantConfig = shares[name].parameters
            others = FleetCoupling(tuple(neighbours), presence(effects_of(shares[name])), **load)
            result[name] = shares[name]._replace(parameters=plant._replace(others=others))
        if name in carriers and name != owner:
            result[name] = _without_bodies(result[name])
    return result


def effects_of(config: ServiceConfig) -> tuple:
    """Return the effects of a multirotor's plant; () for other plants."""
    core = config.parameters.core
    return core.vehicle.effects if isinstance(core, MultirotorPlant) else ()


def _check_separation(shares: Mapping[str, ServiceConfig], keys: Mapping[str, str]) -> None:
    """Raise ConfigError if collision spheres touch at the start."""
    spheres = {
        name: (e.radius, config.parameters.start.vehicle.motion.position_world)
        for name, config in shares.items()
        for e in effects_of(config)
        if isinstance(e, Collision)
    }
    for (one, (r, position)), (other, (other_r, other_position)) in combinations(spheres.items(), 2):
        distance = norm(subtract(position, other_position))
        if distance < r + other_r:
            message = f"got a position {distance:.3g} m from {one}: their collision spheres touch"
            raise ConfigError(f"{keys[other]}initial_position", message, f"at least {r + other_r:.3g} m between them")


def _sling(config: ServiceConfig) -> Sling | None:
    return next((e.sling for e in effects_of(config) if isinstance(e, SharedSlungLoad)), None)


def _without_bodies(config: ServiceConfig) -> ServiceConfig:
    """Return the plant without the load's output, which another vehicle has."""
    plant: PlantConfig = config.parameters
    parameters = plant._replace(encoding=plant.encoding._replace(bodies=()))
    return ServiceConfig(parameters, config.inputs, tuple(port for port in config.ports if port.name != ports.BODIES))


def _load(
    shares: Mapping[str, ServiceConfig], carriers: Mapping[str, Sling], keys: Mapping[str, str]
) -> dict[str, Any]:
    """Return the load's configuration for the first carrier; the load starts in the middle below all hooks."""
    owner, *others = carriers
    first, core = carriers[owner], shares[owner].parameters.core
    for name in others:
        for key, expected, actual in (("mass", first.load_mass, carriers[name].load_mass),
                                  ("drag_area", first.drag_area, carriers[name].drag_area)):  # fmt: skip
            if actual != expected:
                message = f"got {actual:g}, and {owner} has {expected:g}: they carry the same load"
                raise ConfigError(f"{keys[name]}effects.shared_slung_load.{key}", message, f"{expected:g}")
    hooks_world = {name: _hook(shares[name], sling) for name, sling in carriers.items()}
    x, y = (math.total(hook[i] for hook in hooks_world.values()) / len(carriers) for i in (0, 1))
    start = LoadMotion((x, y, surface(first.terrain, x, y)[0]), ZERO)
    for name, sling in carriers.items():
        key, distance = f"{keys[name]}effects.shared_slung_load", norm(subtract(hooks_world[name], start.load_position))
        if distance > sling.length:
            message = f"got {sling.length:g} m, and the load is {distance:.2f} m away, in the middle of its carriers"
            raise ConfigError(f"{key}.length", message, f"at least {distance:.3g} m, or vehicles closer together")
        angle = frequency(sling, shares[name].parameters.core.vehicle.body.mass) * core.interval
        if angle > FASTEST:
            message = f"the load swings along the cable by {angle:.2g} rad in a communication step"
            raise ConfigError(f"{key}.stiffness", message, f"at most {FASTEST:g} rad: a softer cable, or a higher rate")
    field = hooks.all_fields(core.vehicle.effects, shares[owner].parameters.start.vehicle.memory, ZERO)
    method = integrators.get("rk4").Method()
    tolerance = max(core.vehicle.tolerance, integrators.LEAST_TOLERANCE)
    plant = LoadPlant(tuple(carriers.values()), field, method, core.step, core.steps, core.interval, tolerance)
    inputs = tuple(PRESENCE if name == owner else neighbour_port(name, PRESENCE) for name in carriers)
    return {"load": plant, "load_start": start, "load_inputs": inputs}


def _hook(config: ServiceConfig, sling: Sling) -> Vec3:
    """Return the initial position of the cable's attachment [m], world."""
    motion = config.parameters.start.vehicle.motion
    return add(motion.position_world, rotate(motion.attitude, sling.hook_body))
