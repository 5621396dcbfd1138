"""Procedure of `lapwing effects`: each effect and option removed or added once, then the smallest sufficient set."""

import math
from collections.abc import Callable, Collection
from typing import Any, NamedTuple

import numpy as np

from lapwing.cosim.scene import Scene
from lapwing.dynamics import effects
from lapwing.dynamics.effects._vehicle_interaction import INTERACTION
from lapwing.services.autopilot.schema import Autopilot
from lapwing.services.common.vehicle_schema import Effects, Vehicle
from lapwing.studies.effects.cost import costs
from lapwing.studies.effects.variants import Tables, VariantPool, check_effects, variant_pool
from lapwing.studies.flight_data import FlightData


class Influence(NamedTuple):
    """Change of a flight by one effect; infinite if the changed flight fails."""

    trajectory: float  # [m] largest distance at equal times
    final: float  # [m] distance of the final positions
    energy: float  # relative change of the electrical energy
    failure: str = ""  # error of the changed flight


def influence(reference: FlightData, other: FlightData) -> Influence:
    """Return the difference of `other` from `reference`; a shorter flight is extended by its last state."""
    if other.failure:
        return Influence(np.inf, np.inf, np.inf, other.failure)
    count = max(len(reference.truth), len(other.truth))
    a, b = (_extend(flight.truth.position, count) for flight in (reference, other))
    distance = np.linalg.norm(a - b, axis=1)
    change = (other.energy - reference.energy) / reference.energy if reference.energy else 0.0
    return Influence(float(distance.max()), float(distance[-1]), float(change))


def _extend(position: np.ndarray, count: int) -> np.ndarray:
    return np.concatenate([position, np.repeat(position[-1:], count - len(position), axis=0)])


class Row(NamedTuple):
    """Result of one effect, or of one option of an effect, which the scene has or not."""

    name: str  # `EFFECT` or `EFFECT.KEY`
    active: bool  # True if the scene has the effect
    influence: Influence | None  # of its removal or addition; None if that is impossible
    airborne: float  # [ns] share of a plant step while hovering
    standing: float  # [ns] share of a plant step on the ground
    remark: str = ""


class Study(NamedTuple):
    """Result of `lapwing effects`."""

    scene: str
    within: float  # [m] tolerance
    airborne: float  # [ns] of a plant step with the scene's effects, hovering
    standing: float  # [ns] of one on the ground
    rows: tuple[Row, ...]
    smallest: tuple[str, ...]  # effects that keep the trajectory within the tolerance
    distance: float  # [m] largest distance of the flight with these only
    smallest_airborne: float  # [ns] of a plant step with these
    smallest_standing: float  # [ns]
    noise: tuple[float, float]  # [ns] differences of cost below these are not significant: hovering, on the ground

    @property
    def missing(self) -> list[Row]:
        """Effects not in the scene with an influence above the tolerance."""
        return [r for r in self.rows if not r.active and r.influence and r.influence.trajectory > self.within]


def study(
    scene: Scene, within: float, report: Callable[[str, int, int], None], only: Collection[str] | None = None
) -> Study:
    """Fly the scene without each of its effects, with each of the others, and with reduced sets.

    Options of its effects that their modules list in `OPTIONS` are removed or added likewise.

    Args:
        scene: scene of a multirotor.
        within: [m] largest distance of the flight with the smallest set from that of the scene.
        report: called with a description of the work, the number of finished flights, and their total.
        only: names of the effects to remove or add; None for all.

    Raises:
        ValueError: the scene's model has no effects, `only` has an unknown one, or the flight of the scene fails.
    """
    if not scene.has(Autopilot):
        raise ValueError(f"{scene.path}: the model {scene[Vehicle].model} has no effects; expected a multirotor")
    tables = scene[Effects].tables
    names = sorted({*effects.names(), *tables}) if only is None else sorted(set(only))
    classes = {name: effects.parameter_class(name) for name in names if name not in tables}
    multi_vehicle_effects = [name for name, kind in classes.items() if kind in INTERACTION]
    variants_without = {name: _without(tables, name) for name in tables if name in names}
    variants_with = {name: {**tables, name: {}} for name in classes if name not in multi_vehicle_effects}
    variants_without |= _options(tables, names, active=True)
    variants_with |= _options(tables, names, active=False)
    errors = {name: why for name, v in (variants_without | variants_with).items() if (why := check_effects(scene, v))}
    valid_variants = {name: v for name, v in (variants_without | variants_with).items() if name not in errors}
    result: dict[str, Influence] = {}
    with variant_pool(scene) as pool:
        flights = pool.fly([tables, *valid_variants.values()])
        count = len(valid_variants) + 1
        report("flying the scene", 0, count)
        reference = next(flights)
        if reference.failure:
            raise ValueError(f"{scene.path}: {reference.failure}")
        for i, (name, flight) in enumerate(zip(valid_variants, flights, strict=True), 1):
            report(f"{'without' if name in variants_without else 'with'} {name}", i + 1, count)
            result[name] = influence(reference, flight)
        removable = sorted((n for n in tables if n in result), key=lambda n: result[n].trajectory)
        removable = [n for n in removable if result[n].trajectory <= within]
        smallest, distance = _smallest(
            pool, tables, reference, removable, within, lambda text: report(text, count, count + 1)
        )
    report("measuring the plant's steps", count + 1, count + 1)
    order = list(valid_variants)
    full_cost, smallest_cost, *variant_costs = all_costs = costs(scene, [tables, smallest, *valid_variants.values()])
    rows = []
    for name in sorted(variants_without) + sorted(variants_with):
        sign = 1.0 if name in variants_without else -1.0
        without = variant_costs[order.index(name)] if name in valid_variants else (math.nan, math.nan)
        airborne, standing = (sign * (a - b) for a, b in zip(full_cost[:2], without[:2], strict=True))
        rows.append(Row(name, name in variants_without, result.get(name), airborne, standing, errors.get(name, "")))
    unknown = math.nan, math.nan
    rows += [
        Row(name, False, None, *unknown, f"effects.{name}: requires other vehicles") for name in multi_vehicle_effects
    ]
    noise = max(cost.airborne_noise for cost in all_costs), max(cost.standing_noise for cost in all_costs)
    return Study(scene.name, within, *full_cost[:2], tuple(rows), tuple(smallest), distance, *smallest_cost[:2], noise)


def _options(tables: Tables, names: Collection[str], active: bool) -> dict[str, dict[str, Any]]:
    """Return the tables without each option that the scene has (`active`), or with each that it does not have."""
    result = {}
    for name in sorted(set(tables) & set(names)):
        table = dict(tables[name])
        for key, value in effects.options(name, table.get("module")).items():
            if (key in table) == active:
                other = {k: v for k, v in table.items() if k != key} if active else {**table, key: value}
                result[f"{name}.{key}"] = {**tables, name: other}
    return result


def _without(tables: Tables, *names: str) -> dict[str, Any]:
    return {name: table for name, table in tables.items() if name not in names}


def _smallest(
    pool: VariantPool,
    tables: Tables,
    reference: FlightData,
    removable: list[str],
    within: float,
    report: Callable[[str], None],
) -> tuple[dict[str, Any], float]:
    """Return the tables after the removal of as many effects of `removable` as possible, and the distance [m].

    Each of them alone is within the tolerance. While all together are not, the one of most influence is restored.
    """
    while removable:
        smallest = _without(tables, *removable)
        report(f"without {', '.join(removable)} together")
        distance = influence(reference, next(iter(pool.fly([smallest])))).trajectory
        if distance <= within:
            return smallest, distance
        removable = removable[:-1]
    return dict(tables), 0.0
