"""Procedure of `lapwing effects`: each effect and option removed or added once, then the smallest sufficient set."""

import math
from collections.abc import Callable, Collection, Sequence
from typing import NamedTuple

import numpy as np

from lapwing.cosim.scene import Scene
from lapwing.dynamics import effects
from lapwing.dynamics.effects._vehicle_interaction import INTERACTION
from lapwing.flights.flight_data import FlightData
from lapwing.services.autopilot.schema import Autopilot
from lapwing.services.common.firmware.schema import TABLE, flown_by_firmware, require_program
from lapwing.services.common.schemas.vehicle_schema import Vehicle
from lapwing.studies.effects.cost import costs
from lapwing.studies.effects.variants import (
    Change,
    Tables,
    VariantPool,
    changes,
    check_effects,
    names_of,
    tables_of,
    variant_pool,
    without,
)


class Influence(NamedTuple):
    """Change of a flight by one effect, the largest of all vehicles; infinite if the changed flight fails."""

    trajectory: float  # [m] largest distance at equal times
    final: float  # [m] distance of the final positions
    energy: float  # relative change of the electrical energy of all vehicles
    failure: str = ""  # error of the changed flight
    vehicle: str = ""  # name of the vehicle whose trajectory changes most; "" if none changes


def influence(reference: Sequence[FlightData], other: Sequence[FlightData]) -> Influence:
    """Return the difference of the flights `other` of all vehicles from `reference`.

    A shorter flight is extended by its last state.
    """
    if other[0].failure:
        return Influence(np.inf, np.inf, np.inf, other[0].failure)
    distances = [_distances(*pair) for pair in zip(reference, other, strict=True)]
    largest = [float(distance.max()) for distance in distances]
    before, after = (sum(flight.energy for flight in flights) for flights in (reference, other))
    return Influence(
        max(largest),
        max(float(distance[-1]) for distance in distances),
        float((after - before) / before) if before else 0.0,
        vehicle=reference[largest.index(max(largest))].vehicle if any(largest) else "",
    )


def _distances(reference: FlightData, other: FlightData) -> np.ndarray:
    """Return the distance [m] at equal times, shape (n,)."""
    count = max(len(reference.truth), len(other.truth))
    a, b = (_extend(flight.truth.position, count) for flight in (reference, other))
    return np.linalg.norm(a - b, axis=1)


def _extend(position: np.ndarray, count: int) -> np.ndarray:
    return np.concatenate([position, np.repeat(position[-1:], count - len(position), axis=0)])


class Row(NamedTuple):
    """Result of one effect, or of one option of an effect.

    An effect that only some vehicles have has two rows: its removal from these, and its addition to the others.
    """

    name: str  # `EFFECT` or `EFFECT.KEY`
    active: bool  # True if at least one vehicle has the effect, which is removed
    influence: Influence | None  # of its removal or addition; None if that is impossible
    airborne: float  # [ns] share of a plant step of all vehicles while hovering
    standing: float  # [ns] share of a plant step of all vehicles on the ground
    remark: str = ""


class Study(NamedTuple):
    """Result of `lapwing effects`."""

    scene: str
    within: float  # [m] tolerance
    airborne: float  # [ns] of a plant step of all vehicles with the scene's effects, hovering
    standing: float  # [ns] of one on the ground
    rows: tuple[Row, ...]
    smallest: tuple[str, ...]  # effects that keep the trajectory within the tolerance
    distance: float  # [m] largest distance of the flight with these only
    smallest_airborne: float  # [ns] of a plant step with these
    smallest_standing: float  # [ns]
    noise: tuple[float, float]  # [ns] differences of cost below these are not significant: hovering, on the ground
    vehicles: tuple[str, ...]  # names

    @property
    def missing(self) -> list[Row]:
        """Effects that not all vehicles have, with an influence of their addition above the tolerance."""
        return [r for r in self.rows if not r.active and r.influence and r.influence.trajectory > self.within]


def study(
    scene: Scene, within: float, report: Callable[[str, int, int], None], only: Collection[str] | None = None
) -> Study:
    """Fly the scene without each of its effects, with each of the others, and with reduced sets.

    Options of its effects that their modules list in `OPTIONS` are removed or added likewise. See `variants.changes`
    for effects that only some vehicles of a scene have.

    Args:
        scene: scene of multirotors.
        within: [m] largest distance of a flight with the smallest set from that of the scene, for all vehicles.
        report: called with a description of the work, and the numbers of finished and of all parts.
        only: names of the effects to remove or add; None for all.

    Raises:
        ValueError: a vehicle's model has no effects, a foreign firmware that flies one has no program or is not
            repeatable, `only` has an unknown effect, or the flight of the scene fails.
    """
    vehicles = scene.each_vehicle
    for vehicle in vehicles:
        if not vehicle.has(Autopilot):
            raise ValueError(f"{scene.path}: the model {vehicle[Vehicle].model} has no effects; expected a multirotor")
        require_program(vehicle)
        if flown_by_firmware(vehicle) and not vehicle.section(TABLE).repeatable:
            raise ValueError(
                f"{scene.path}: {TABLE}.repeatable = false: flights differ also without a change; expected true"
            )
    tables = tables_of(scene)
    present = names_of(tables)
    names = sorted({*effects.names(), *present} if only is None else set(only))
    absent = [name for name in names if name not in present]
    interacting = [name for name in absent if effects.parameter_class(name) in INTERACTION]
    impossible = interacting if len(vehicles) == 1 else []
    variants = changes(tables, [name for name in names if name not in impossible])
    errors = {change: why for change, v in variants.items() if (why := check_effects(scene, v))}
    valid_variants = {change: v for change, v in variants.items() if change not in errors}
    result: dict[Change, Influence] = {}
    with variant_pool(scene) as pool:
        flights = pool.fly([tables, *valid_variants.values()])
        count = len(valid_variants) + 1
        total = 2 * count + 2  # flights; kernels of the plant's step with each of them and the smallest set; their cost
        report("flying the scene; each set of effects compiles once", 0, total)
        reference = next(flights)
        if failure := reference[0].failure:
            raise ValueError(f"{scene.path}: {failure}")
        for done, change in enumerate(valid_variants, 1):
            report(_text_of(change), done, total)
            result[change] = influence(reference, next(flights))
        distances = {name: i.trajectory for (name, removed), i in result.items() if removed and name in present}
        removable = sorted((name for name, d in distances.items() if d <= within), key=distances.__getitem__)
        smallest, distance = _smallest(
            pool, tables, reference, removable, within, lambda text: report(text, count, total)
        )
    names = ["of the scene", "of the smallest set", *map(_text_of, valid_variants)]

    def loading(loaded: int) -> None:
        compiling = [f"compiling (once) or loading the plant's step {name}" for name in names]
        report([*compiling, "measuring the plant's steps"][loaded], count + loaded, total)

    all_costs = costs(scene, [tables, smallest, *valid_variants.values()], loading)
    full_cost, smallest_cost, *others = all_costs
    variant_costs = dict(zip(valid_variants, others, strict=True))
    rows = []
    for change in sorted(variants, key=lambda change: (not change.removed, change.name)):
        sign = 1.0 if change.removed else -1.0
        changed_cost = variant_costs[change][:2] if change in variant_costs else (math.nan, math.nan)
        airborne, standing = (sign * (a - b) for a, b in zip(full_cost[:2], changed_cost, strict=True))
        row = Row(change.name, change.removed, result.get(change), airborne, standing, errors.get(change, ""))
        rows.append(row)
    unknown = math.nan, math.nan
    rows += [Row(name, False, None, *unknown, f"effects.{name}: requires other vehicles") for name in impossible]
    return Study(
        scene.name,
        within,
        *full_cost[:2],
        tuple(rows),
        tuple(names_of(smallest)),
        distance,
        *smallest_cost[:2],
        (max(cost.airborne_noise for cost in all_costs), max(cost.standing_noise for cost in all_costs)),
        tuple(vehicle[Vehicle].name for vehicle in vehicles),
    )


def _text_of(change: Change) -> str:
    return f"{'without' if change.removed else 'with'} {change.name}"


def _smallest(
    pool: VariantPool,
    tables: Tables,
    reference: Sequence[FlightData],
    removable: list[str],
    within: float,
    report: Callable[[str], None],
) -> tuple[Tables, float]:
    """Return the tables after the removal of as many effects of `removable` as possible, and the distance [m].

    Each of them alone is within the tolerance. While all together are not, the one of most influence is restored.
    """
    while removable:
        smallest = without(tables, removable)
        report(f"without {', '.join(removable)}{' together' if len(removable) > 1 else ', to find the smallest set'}")
        distance = influence(reference, next(iter(pool.fly([smallest])))).trajectory
        if distance <= within:
            return smallest, distance
        removable = removable[:-1]
    return tables, 0.0
