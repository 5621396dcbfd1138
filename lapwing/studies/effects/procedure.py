"""The whole study: every effect left out or added once, and the smallest set that keeps the flight."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from lapwing.cosim.scene import Scene
from lapwing.dynamics import effects
from lapwing.dynamics.effects._vehicle_interaction import INTERACTION
from lapwing.services.autopilot.schema import Autopilot
from lapwing.services.common.vehicle_schema import Effects, Vehicle
from lapwing.studies.effects.cost import costs
from lapwing.studies.effects.influence import Influence, influence
from lapwing.studies.effects.variants import Tables, VariantPool, hangar, refusal
from lapwing.studies.flight_data import FlightData


class Row(NamedTuple):
    """One effect: of the scene, or of the catalogue and left out."""

    name: str
    active: bool
    influence: Influence | None  # of leaving it out, or of adding it; None where that cannot be
    airborne: float  # [ns] that it adds to a plant step while hovering
    standing: float  # [ns] that it adds to a plant step on the ground
    remark: str = ""


class Study(NamedTuple):
    """Result of `lapwing effects`."""

    scene: str
    within: float  # [m]
    airborne: float  # [ns] of a plant step with the scene's effects, hovering
    standing: float  # [ns] of one on the ground
    rows: tuple[Row, ...]
    smallest: tuple[str, ...]  # effects that keep the trajectory within the tolerance
    apart: float  # [m] largest distance of the flight with these only
    smallest_airborne: float  # [ns] of a plant step with these
    smallest_standing: float  # [ns]
    noise: tuple[float, float]  # [ns] differences of cost below these are not significant: hovering, on the ground

    @property
    def missing(self) -> list[Row]:
        """Effects that the scene leaves out and that would change it by more than the tolerance."""
        return [r for r in self.rows if not r.active and r.influence and r.influence.trajectory > self.within]


def study(scene: Scene, within: float, say: Callable[[str, int, int], None]) -> Study:
    """Fly the scene without each of its effects, with each of the others, and with fewer and fewer.

    Args:
        scene: of a multirotor.
        within: [m] how far the flight with the smallest set may be from the scene's own at any time.
        say: told what has been flown or is being done, how many flights are done, and of how many.

    Raises:
        ValueError: the scene's model knows no effects, or the scene itself comes to no end.
    """
    if not scene.has(Autopilot):
        raise ValueError(f"{scene.path}: the model {scene[Vehicle].model} knows no effects; expected a multirotor")
    tables = scene[Effects].tables
    fewer = {name: _without(tables, name) for name in tables}
    alone = [name for name in effects.names() if effects.parameter_class(name) not in INTERACTION]  # no other vehicle
    more = {name: {**tables, name: {}} for name in alone if name not in tables}
    refused = {name: why for name, v in (fewer | more).items() if (why := refusal(scene, v))}
    among = [name for name in effects.names() if name not in alone and name not in tables]
    flying = {name: v for name, v in (fewer | more).items() if name not in refused}
    result: dict[str, Influence] = {}
    with hangar(scene) as crew:
        flights = crew.fly([tables, *flying.values()])
        count = len(flying) + 1
        say("flying the scene as it is", 0, count)
        reference = next(flights)
        if reference.failure:
            raise ValueError(f"{scene.path}: {reference.failure}")
        for i, (name, flight) in enumerate(zip(flying, flights, strict=True), 1):
            say(f"{'without' if name in tables else 'with'} {name}", i + 1, count)
            result[name] = influence(reference, flight)
        out = sorted((n for n in fewer if n in result), key=lambda n: result[n].trajectory)
        out = [n for n in out if result[n].trajectory <= within]
        smallest, apart = _smallest(crew, tables, reference, out, within, lambda text: say(text, count, count + 1))
    say("timing the plant's steps", count + 1, count + 1)
    names = list(flying)
    full, least, *each = measured = costs(scene, [tables, smallest, *flying.values()])
    rows = []
    for name in sorted(fewer) + sorted(more):
        sign = 1.0 if name in fewer else -1.0
        without = each[names.index(name)] if name in flying else (math.nan, math.nan)
        airborne, standing = (sign * (a - b) for a, b in zip(full[:2], without[:2], strict=True))
        rows.append(Row(name, name in fewer, result.get(name), airborne, standing, refused.get(name, "")))
    unknown = math.nan, math.nan
    rows += [Row(name, False, None, *unknown, f"effects.{name}: needs other vehicles") for name in among]
    noise = max(cost.airborne_noise for cost in measured), max(cost.standing_noise for cost in measured)
    return Study(scene.name, within, *full[:2], tuple(rows), tuple(smallest), apart, *least[:2], noise)


def _without(tables: Tables, *names: str) -> dict[str, Any]:
    return {name: table for name, table in tables.items() if name not in names}


def _smallest(
    crew: VariantPool, tables: Tables, reference: FlightData, out: list[str], within: float, say: Callable[[str], None]
) -> tuple[dict[str, Any], float]:
    """Return the effects that remain after the removal of as many of `out` as possible, and the resulting difference.

    Each of `out` alone is within the tolerance; while all together are not, the one of most influence is restored.
    """
    while out:
        smallest = _without(tables, *out)
        say(f"without {', '.join(out)} together")
        apart = influence(reference, next(iter(crew.fly([smallest])))).trajectory
        if apart <= within:
            return smallest, apart
        out = out[:-1]
    return dict(tables), 0.0
