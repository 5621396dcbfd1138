"""Resolution of a scene: its vocabulary of tables, and the run configuration for all services."""

import importlib
import importlib.util
import pkgutil
from collections.abc import Mapping, Sequence
from functools import cache
from operator import index
from pathlib import Path
from types import MappingProxyType, ModuleType
from typing import Any

import lapwing.services
from lapwing.cosim import scene as scenes
from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram import multi_vehicle
from lapwing.cosim.scene import Overrides, Scene, SceneError, Vocabulary
from lapwing.services.common import user_modules
from lapwing.services.common.firmware.schema import FIRMWARES
from lapwing.services.common.schemas import communication_schema as exchange
from lapwing.services.common.schemas import environment_schema, fence_schema, mesh_schema, run_schema, success_criteria
from lapwing.services.common.schemas import vehicle_schema as vehicle
from lapwing.services.common.schemas.communication_schema import Communication
from lapwing.services.common.schemas.fence_schema import FenceTable
from lapwing.services.common.schemas.run_schema import Run
from lapwing.services.common.schemas.vehicle_schema import Vehicle
from lapwing.services.plant import models
from lapwing.services.process_table import AUTOPILOT, FMU, PROCESSES, entry


def _resolvers() -> dict[str, ModuleType]:
    """Return the module `resolve` of each process that has one; imported when a scene is resolved."""
    from lapwing.fmi.importer import resolve as fmu
    from lapwing.services.ardupilot import resolve as ardupilot
    from lapwing.services.autopilot import resolve as autopilot
    from lapwing.services.betaflight import resolve as betaflight
    from lapwing.services.formation import resolve as formation
    from lapwing.services.mavlink import resolve as mavlink
    from lapwing.services.plant import resolve as plant
    from lapwing.services.px4 import resolve as px4
    from lapwing.services.sensors import resolve as sensors
    from lapwing.services.trajectory import resolve as trajectory

    modules = (ardupilot, autopilot, betaflight, formation, mavlink, plant, px4, sensors, trajectory)
    return {"fmu": fmu, **{module.__name__.split(".")[-2]: module for module in modules}}


def _configurations() -> list[ModuleType]:
    """Return the `schema` modules of all services."""
    folders = sorted(p.name for p in pkgutil.iter_modules(lapwing.services.__path__) if p.ispkg)
    paths = ["lapwing.fmi.importer.schema", *(f"lapwing.services.{name}.schema" for name in folders)]
    return [importlib.import_module(path) for path in paths if importlib.util.find_spec(path)]


@cache
def vocabulary() -> Vocabulary:
    """Return all possible scene tables: shared ones, those of services, and those of plant models."""
    shared = [
        run_schema,
        success_criteria,
        exchange,
        environment_schema,
        fence_schema,
        vehicle,
        user_modules,
        mesh_schema,
    ]
    tables = [*shared, *_configurations(), *map(models.get, models.names())]
    return Vocabulary.of(tables, models.check)


def load(scene: Scene | str | Path, overrides: Overrides = ()) -> Scene:
    """Read a scene and the files that it names, apply overrides, and validate it.

    Args:
        scene: path of its TOML file or SSP package, name of a shipped scene, or a loaded scene.
        overrides: "dotted.key=value" with a TOML value (a bare word counts as a text), or values by dotted key. Keys of
            the files that it names are allowed: "airframe.mass.total=9.5".

    Raises:
        SceneError: names the key, the fault and the expected value.
    """
    if isinstance(scene, Scene):
        return scenes.with_overrides(scene, overrides, vocabulary()) if overrides else scene
    if not isinstance(scene, str | Path):
        raise SceneError("scene", f"got {scene!r}", "a name, a path, or a loaded scene")
    if Path(scene).suffix == ".ssp":
        return _load_package(Path(scene), overrides)
    return scenes.load(scene, overrides, vocabulary(), run_schema.SHIPPED)


def _load_package(path: Path, overrides: Overrides) -> Scene:
    from lapwing.fmi.importer.system_structure import scene_of_package

    tree = scene_of_package(path, lambda name, text: dict(parse(name, text).resolved))
    return scenes.from_resolved(scenes.with_values(tree, overrides), vocabulary(), path.stem)


def load_one(scene: Scene | str | Path, overrides: Overrides = ()) -> Scene:
    """Load a scene with a single vehicle. Raise SceneError if it has several."""
    loaded = load(scene, overrides)
    loaded[Vehicle]  # raises SceneError for several vehicles
    return loaded


def parse(path: Path, text: str, overrides: Overrides = ()) -> Scene:
    """Load a scene from its text; `path` is its name and the base of relative files."""
    return scenes.parse(path, text, overrides, vocabulary())


def from_resolved(tree: Mapping[str, Any], name: str = "scene") -> Scene:
    """Return the scene whose `resolved` is `tree`, without opening a file. Raise SceneError if it is invalid."""
    return scenes.from_resolved(tree, vocabulary(), name)


def reseed(config: RunConfig, seed: int) -> RunConfig:
    """Return the run configuration with another seed, equal to `resolve` of the scene with that seed, but faster.

    Raises:
        SceneError: the seed is invalid.
    """
    if not hasattr(seed, "__index__") or not 0 <= (number := index(seed)) < 2**63:
        raise SceneError("run.seed", f"got {seed!r}", "a whole number from 0 to 2^63 - 1")
    seed = number
    if not config.vehicle:
        resolved = {**config.resolved, Run.TABLE: {**config.resolved[Run.TABLE], "seed": seed}}
        return multi_vehicle.merge_configs([reseed(member, seed) for member in multi_vehicle.members(config)], resolved)
    services_of = dict(config.services)
    for name, settings in services_of.items():
        module = _resolvers()[entry(name).name]
        if hasattr(module, "reseed"):
            services_of[name] = module.reseed(settings, seed, config.vehicle)
    run = {**config.resolved[Run.TABLE], "seed": seed}
    return config._replace(seed=seed, services=services_of, resolved={**config.resolved, Run.TABLE: run})


def resolve(scene: Scene, plans: Mapping[str, tuple[Any, ...]] = MappingProxyType({})) -> RunConfig:
    """Return the run configuration of a scene.

    Args:
        scene: loaded scene.
        plans: operator commands of the first tick, by vehicle name.

    Raises:
        SceneError: a value is invalid; names its key and what is expected.
    """
    if scene.vehicles:
        members = []
        for vehicle in scene.vehicles:
            with vehicle.located():
                members.append(_resolve(vehicle, plans))
        with scene.located():
            members = _with_fleet_coupling(members, scene.vehicles, "vehicle.{}.")
            return multi_vehicle.merge_configs(members, dict(scene.resolved))
    with scene.located():
        (config,) = _with_fleet_coupling([_resolve(scene, plans)], [scene], "")
        return config


def _with_fleet_coupling(members: list[RunConfig], vehicles: Sequence[Scene], key: str) -> list[RunConfig]:
    """Return the configurations of all vehicles, combined by the services whose `resolve.py` has `fleet`.

    `vehicles` are the scenes of the members; `key` is the prefix of a vehicle's keys, with {} for its number.
    """
    scenes = {member.vehicle: scene for member, scene in zip(members, vehicles, strict=True)}
    keys = {member.vehicle: key.format(i) for i, member in enumerate(members)}
    for name in dict.fromkeys(name for member in members for name in member.services):
        module = _resolvers()[entry(name).name]
        if hasattr(module, "fleet"):
            shares = {member.vehicle: member.services[name] for member in members if name in member.services}
            result = module.fleet(shares, keys, scenes)
            members = [
                member._replace(services={**member.services, name: result[member.vehicle]})
                if member.vehicle in result
                else member
                for member in members
            ]
    return members


def _resolve(scene: Scene, plans: Mapping[str, tuple[Any, ...]]) -> RunConfig:
    exchange, run = scene[Communication], scene[Run]
    result: dict[str, Any] = {}
    auxiliary: dict[str, Any] = {}
    for process in PROCESSES:
        if process.name != FMU and (process.lock_step or process.resolves):
            config = _resolvers()[process.name].resolve(scene)
            if config is not None:
                (result if process.lock_step else auxiliary)[process.name] = config
    result = _resolvers()[FMU].connect(scene, result)
    plan = plans.get(scene[Vehicle].name, ())
    for name in [name for name in (AUTOPILOT, *FIRMWARES) if name in result and (plan or scene.has(FenceTable))]:
        parameters = fence_schema.with_fence(scene, result[name].parameters, plan)
        result[name] = result[name]._replace(parameters=parameters)
    return RunConfig(
        scene.name,
        run.title,
        run.seed,
        round(run.duration * exchange.rate),
        exchange.rate,
        exchange.interval_ns,
        exchange.coupling,
        scene[Vehicle].name,
        result,
        auxiliary,
        dict(scene.resolved),
    )
