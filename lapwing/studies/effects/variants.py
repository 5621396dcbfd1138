"""Variants of a scene with other effects, and their flights on all cores.

The effects of a scene are one mapping of tables for each vehicle; a single vehicle is a fleet of one.
"""

import os
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from typing import Any, NamedTuple

from lapwing.cosim.scene import Scene
from lapwing.dynamics import effects
from lapwing.dynamics.config_error import ConfigError
from lapwing.flights.flight_data import FlightData
from lapwing.messages.topics import TRUTH
from lapwing.services.common.firmware.schema import firmware_of
from lapwing.services.common.schemas.vehicle_schema import Effects
from lapwing.services.scene_resolver import resolve
from lapwing.studies.simulate import fly_each
from lapwing.studies.workers import workers

Tables = tuple[Mapping[str, Any], ...]  # tables of the effects of each vehicle, by name


class Change(NamedTuple):
    """Removal of an effect or option from the vehicles that have it, or addition to those that do not."""

    name: str  # `EFFECT` or `EFFECT.KEY`
    removed: bool


def tables_of(scene: Scene) -> Tables:
    """Return the tables of the effects of each vehicle."""
    return tuple(vehicle[Effects].tables for vehicle in scene.each_vehicle)


def names_of(tables: Tables) -> list[str]:
    """Return the names of the effects that at least one vehicle has."""
    return list(dict.fromkeys(name for own in tables for name in own))


def without(tables: Tables, names: Collection[str]) -> Tables:
    """Return the tables after the removal of some effects from all vehicles."""
    return tuple({name: table for name, table in own.items() if name not in names} for own in tables)


def changes(tables: Tables, names: Collection[str]) -> dict[Change, Tables]:
    """Return the tables after the removal or addition of each of these effects, and of each of their options.

    An effect that only some vehicles have is removed from these, and added to the others with the table of the first
    vehicle that has it. Options are the keys that an effect's module lists in `OPTIONS`, with typical values.
    """
    present, result = names_of(tables), {}
    for name in (name for name in present if name in names):
        result[Change(name, True)] = without(tables, [name])
    for name in (name for name in names if not all(name in own for own in tables)):
        table: Mapping[str, Any] = next((own[name] for own in tables if name in own), {})
        result[Change(name, False)] = tuple(own if name in own else {**own, name: table} for own in tables)
    for name in sorted(set(present).intersection(names)):
        module = next(own[name].get("module") for own in tables if name in own)
        for key, value in effects.options(name, module).items():
            has_key = [key in own[name] for own in tables if name in own]
            if any(has_key):
                result[Change(f"{name}.{key}", True)] = tuple(_without_key(own, name, key) for own in tables)
            if not all(has_key):
                result[Change(f"{name}.{key}", False)] = tuple(_with_key(own, name, key, value) for own in tables)
    return result


def _without_key(own: Mapping[str, Any], name: str, key: str) -> Mapping[str, Any]:
    return {**own, name: {k: v for k, v in own[name].items() if k != key}} if name in own else own


def _with_key(own: Mapping[str, Any], name: str, key: str, value: Any) -> Mapping[str, Any]:
    return {**own, name: {key: value, **own[name]}} if name in own else own


def variant(scene: Scene, tables: Tables) -> Scene:
    """Return the scene with these effects instead of its own."""
    vehicles = [
        vehicle.replaced(Effects.model_validate(dict(own)))
        for vehicle, own in zip(scene.each_vehicle, tables, strict=True)
    ]
    return scene.with_vehicles(vehicles) if scene.vehicles else vehicles[0]


def check_effects(scene: Scene, tables: Tables) -> str:
    """Return the error if a scene cannot have these effects; "" if it can."""
    try:
        resolve(variant(scene, tables))
    except ConfigError as error:
        return ConfigError.__str__(error)  # without the place in the scene's file, which does not have the effect
    return ""


def fly_for_truth(scene: Scene) -> list[FlightData]:
    """Fly the scene to its end. Return the flight of each vehicle with the ground truth alone."""
    return fly_each(scene, (TRUTH,))  # the topic itself: a copy of it in a worker would be another one


class VariantPool:
    """Pool of processes that fly variants of one scene; each set of effects is compiled once and cached on disk."""

    def __init__(self, scene: Scene, pool: ProcessPoolExecutor):
        self._scene, self._pool = scene, pool

    def fly(self, variants: Iterable[Tables]) -> Iterator[Sequence[FlightData]]:
        """Yield the flights of all vehicles of each variant in order, with the ground truth alone."""
        return self._pool.map(fly_for_truth, [variant(self._scene, tables) for tables in variants])


@contextmanager
def variant_pool(scene: Scene) -> Iterator[VariantPool]:
    """Yield a pool whose processes end with the block, immediately after an error, and with this process."""
    fixed_ports = any(firmware_of(vehicle) == "betaflight" for vehicle in scene.each_vehicle)
    with workers(1 if fixed_ports else os.cpu_count() or 1) as pool:
        yield VariantPool(scene, pool)
