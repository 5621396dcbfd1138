"""Variants of a scene with other effects, and their flights on all cores."""

import os
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from typing import Any

from lapwing.cosim.scene import Scene
from lapwing.dynamics import effects
from lapwing.messages.topics import TRUTH
from lapwing.services.common.environment_schema import environment
from lapwing.services.common.vehicle_schema import Effects, airframe
from lapwing.studies.flight_data import FlightData
from lapwing.studies.simulate import fly
from lapwing.studies.workers import workers

Tables = Mapping[str, Any]  # tables of a variant's effects by name


def variant(scene: Scene, tables: Tables) -> Scene:
    """Return the scene with these effects instead of its own."""
    return scene.replaced(Effects.model_validate(dict(tables)))


def check_effects(scene: Scene, tables: Tables) -> str:
    """Return the error if a scene cannot have these effects; "" if it can."""
    try:
        effects.from_scene(tables, airframe(scene), environment(scene))
    except ValueError as error:
        return str(error)
    return ""


def fly_for_truth(scene: Scene) -> FlightData:
    """Fly the scene to its end. Return a flight with the ground truth alone."""
    return fly(scene, (TRUTH,))  # the topic itself: a copy of it in a worker would be another one


class VariantPool:
    """Pool of processes that fly variants of one scene; each set of effects is compiled once and cached on disk."""

    def __init__(self, scene: Scene, pool: ProcessPoolExecutor):
        self._scene, self._pool = scene, pool

    def fly(self, variants: Iterable[Tables]) -> Iterator[FlightData]:
        """Yield the flight of each variant in order, with the ground truth alone."""
        return self._pool.map(fly_for_truth, [variant(self._scene, tables) for tables in variants])


@contextmanager
def variant_pool(scene: Scene) -> Iterator[VariantPool]:
    """Yield a pool whose processes end with the block, immediately after an error, and with this process."""
    with workers(os.cpu_count() or 1) as pool:
        yield VariantPool(scene, pool)
