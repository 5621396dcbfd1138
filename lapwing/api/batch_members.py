"""Members of a batch: the plant of each scene, and checks of their common effects, tables and start states."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lapwing.cosim.scene import Scene, SceneError
from lapwing.dynamics.effects._external_inputs import inputs_of
from lapwing.dynamics.effects._types import Motion
from lapwing.dynamics.terrain import surface
from lapwing.kernels import kernel
from lapwing.services.plant.blocks.multirotor import MultirotorPlant
from lapwing.services.plant.service_config import PlantConfig
from lapwing.services.scene_resolver import resolve

UNIT = 1e-6  # largest error of the norm of an attitude
DEEPEST = 1e-3  # [m] largest depth of a centre of mass below the ground


def plant_of(scene: Scene) -> PlantConfig:
    """Return the plant of a scene.

    Raises:
        SceneError: the scene is invalid, or batches do not step its model.
    """
    plant: PlantConfig = resolve(scene).services["plant"].parameters
    if not isinstance(plant.core, MultirotorPlant) or not isinstance(plant.start.vehicle.motion, Motion):
        raise SceneError("vehicle.model", f"got {plant.model!r}", '"rigid_body", the only one that batches step')
    if inputs_of(plant.core.vehicle.effects):
        raise SceneError("services", "batches step the plant without FMUs", "no FMU with inputs of effects")
    if plant.others:
        raise SceneError(
            "effects.shared_slung_load", "batches step vehicles without carried loads", "a scene without it"
        )
    return plant


def terrain_of(core: MultirotorPlant) -> Any:
    """Return the ground that a vehicle can touch; None without contact."""
    return next((e.terrain for e in core.vehicle.effects if hasattr(e, "terrain") and hasattr(e, "feet")), None)


def check_alike(k: int, core: MultirotorPlant, first: MultirotorPlant) -> None:
    """Check that member k has the effects, solver and tables of member 0, which all members share.

    Raises:
        ValueError: they differ.
    """
    if _kinds(core) != _kinds(first):
        raise ValueError(f"member {k}: has other effects or another solver than member 0")
    for (path, own), (_, shared) in zip(_arrays(core.vehicle.effects), _arrays(first.vehicle.effects), strict=True):
        if not np.array_equal(own, shared):
            raise ValueError(f"member {k}: has other numbers in {path} than member 0; all members share tables")


def _kinds(core: MultirotorPlant) -> tuple:
    effects = core.vehicle.effects
    grounds = (type(e.terrain) for e in effects if hasattr(e, "terrain"))
    return (type(core.method), core.step, core.steps, *map(type, effects), *grounds)


def _arrays(tree: Any, path: str = "") -> Iterator[tuple[str, np.ndarray]]:
    """Yield (path, array) of each array of a tree."""
    if isinstance(tree, np.ndarray):
        yield path, tree
    elif isinstance(tree, tuple):
        for name, part in zip(getattr(tree, "_fields", [""] * len(tree)), tree, strict=True):
            yield from _arrays(part, f"{path}.{name}".strip("."))


def check_start(state: Mapping[str, ArrayLike], members: np.ndarray, terrains: Sequence[Any]) -> None:
    """Check start states of vehicles.

    Args:
        state: fields of `BatchState`, one value for all members or one for each.
        members: numbers of the members.
        terrains: ground of every member of the batch, see `terrain_of`.

    Raises:
        ValueError: a state is invalid.
    """
    checks: dict[str, tuple[str, Any]] = {
        "attitude": ("unit quaternions", lambda v: abs(np.linalg.norm(v, axis=1) - 1.0) <= UNIT),
        "rotor_speed": ("speeds of at least 0 rad/s", lambda v: (v >= 0.0).all(axis=1)),
        "position_world": ("a centre of mass above the ground", lambda v: _above_ground(v, members, terrains)),
    }
    for name, (expected, is_valid) in checks.items():
        if name in state:
            value = np.atleast_2d(np.asarray(state[name], float))
            if not is_valid(value).all():
                raise ValueError(f"{name}: expected {expected}, got {value[~is_valid(value)][0].tolist()}")


def _above_ground(places: np.ndarray, members: np.ndarray, terrains: Sequence[Any]) -> np.ndarray:
    """Return True for each of the places [m], shape (n, 3), that is above the ground of its member or of all."""
    if places.shape[1:] != (3,) or not np.isfinite(places).all() or len(places) not in (1, len(members)):
        return np.ones(len(places), bool)  # reported by `finite_array`
    positions, height = np.broadcast_to(places, (len(members), 3)), np.zeros(len(members))
    groups: dict[int, tuple[Any, list[int]]] = {}
    for i, k in enumerate(members):
        groups.setdefault(id(terrains[k]), (terrains[k], []))[1].append(i)
    for ground, own in groups.values():
        height[own] = -np.inf if ground is None else _heights(ground, np.ascontiguousarray(positions[own]))
    above: np.ndarray = positions[:, 2] >= height - DEEPEST
    return above if len(places) == len(members) else np.array([above.all()])


@kernel
def _heights(ground: Any, places: np.ndarray) -> np.ndarray:
    """Return the height [m] of the ground at places [m], shape (n, 3)."""
    result = np.empty(len(places))
    for i in range(len(places)):
        result[i] = surface(ground, places[i, 0], places[i, 1])[0]
    return result


def finite_array(name: str, values: ArrayLike | None, shape: tuple[int, ...]) -> np.ndarray:
    """Return an array of finite numbers of a shape.

    Raises:
        ValueError: it has another shape, or other values.
    """
    try:
        result = np.asarray(values, float)
    except (TypeError, ValueError):
        result = np.empty(0)
    if result.shape != shape:
        raise ValueError(f"{name}: expected numbers of shape {shape}, got {np.shape(values)}")  # type: ignore[arg-type]
    if not np.isfinite(result).all():
        raise ValueError(f"{name}: expected finite numbers")
    return result
