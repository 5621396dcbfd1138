"""Flight of a plan from a file: QGroundControl's .plan, or .waypoints (QGC WPL 110).

A plan is refused as a whole before the run starts: no part of it is flown without the others.

Format: MAVLink guide, "File formats". The first row is home, row 0, if it has a waypoint in a global frame: such files
have the conventions of ArduPilot.
"""

import json
import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from lapwing.dynamics.environment import STANDARD
from lapwing.dynamics.input_file import read_text, unreadable
from lapwing.dynamics.terrain.heightfield import field
from lapwing.dynamics.terrain.ray_casting import as_relief
from lapwing.kernels import python_function
from lapwing.messages import OperatorCommand
from lapwing.services.common import autopilot_parameters
from lapwing.services.common.mavlink.geo_coordinates import Datum
from lapwing.services.common.plans.converter import convert, label, notes, refusal
from lapwing.services.common.plans.fence import Fence
from lapwing.services.common.plans.plan_item import FENCE, MISSION, RALLY, PlanItem, RefusedItemError
from lapwing.services.common.plans.qgc_plan import EXPECTED, PlanItems, entry, read_json
from lapwing.services.common.plans.route_checks import breach_of, check_first_place, ends_in_the_air, has_place
from lapwing.services.common.schemas.environment_schema import EnvironmentTable, environment
from lapwing.services.common.schemas.vehicle_schema import start_place

if TYPE_CHECKING:
    from lapwing.cosim.scene import Scene

OPERATED = ["autopilot.accept_commands=true", "autopilot.follow_trajectory=false"]  # scene overrides for flying a plan
READY_TIMEOUT = 60.0  # [s] for the vehicle to become ready for take-off
SOURCE = "plan"
LIMIT = "MIS_DIST_1WP"


class Site(NamedTuple):
    """Place at which a plan is flown."""

    datum: Datum = Datum(STANDARD.home)
    start: tuple[float, float] = (0.0, 0.0)  # world x, y of the vehicle [m]
    first_limit: float = 0.0  # [m] maximum distance of the first position from it; 0: any
    ground: Callable[[float, float], float] = lambda x, y: -math.inf  # [m] world z of the ground at x, y


ORIGIN = Site()


class Plan(NamedTuple):
    """A plan that can be flown."""

    commands: tuple[Any, ...]  # `OperatorCommand`s that upload it, fly it, and end the run after landing
    notes: tuple[str, ...]  # one line for each kind of items that are skipped, or flown in another way


def site_of(scene: "Scene", firmware: bool = False) -> Site:
    """Return the site of a scene; the first position has no limit if a firmware with its own flies."""
    x, y, z = start_place(scene)
    limit = 0.0 if firmware else autopilot_parameters.table(scene)[LIMIT].default
    relief = as_relief(scene[EnvironmentTable].terrain.ground())
    return Site(
        Datum(environment(scene).home, z, z), (x, y), limit, lambda x, y: float(python_function(field)(relief, x, y)[0])
    )


def read(path: Path, site: Site = ORIGIN) -> Plan:
    """Return the plan of a file.

    Raises:
        ValueError: (one line) the file is missing, has another format, or contains a part that cannot be flown.
    """
    try:
        text = read_text(path, "utf-8-sig")
    except OSError as error:
        raise unreadable(path, error, "a mission file (.plan, .waypoints)") from None
    except UnicodeDecodeError:
        raise ValueError(f"{path}: not a UTF-8 text file; expected a .plan or .waypoints file") from None
    return parse(path, text, site)


def parse(path: Path, text: str, site: Site = ORIGIN) -> Plan:
    """Return the plan with this content. See `read` for errors."""
    try:
        text = text.removeprefix("\ufeff")
        return _plan(read_rows(text) if text.startswith(HEADER) else read_json(json.loads(text)), site)
    except KeyError as error:
        raise ValueError(f"{path}: not a plan: key {error} is missing; {EXPECTED}") from None
    except (TypeError, IndexError, AttributeError, OverflowError):
        raise ValueError(f"{path}: not a plan: an entry has the wrong type or length; {EXPECTED}") from None
    except RecursionError:
        raise ValueError(f"{path}: not a plan: nested too deeply") from None
    except json.JSONDecodeError as error:
        raise ValueError(f"{path}: neither JSON (.plan) nor {HEADER} {VERSION} (.waypoints): {error}") from None
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _plan(items: PlanItems, site: Site) -> Plan:
    """Return the plan of a file's items. Raise ValueError if it cannot be flown."""
    if not items.mission:
        raise ValueError("contains no mission item; add a take-off and a landing")
    route = convert(items.mission, MISSION, site.datum, items.ardupilot)
    shapes, rally = (convert(each, kind, site.datum) for each, kind in ((items.fence, FENCE), (items.rally, RALLY)))
    try:
        check_first_place(route, site.start, site.first_limit)
    except RefusedItemError as error:
        raise refusal(items.mission, error) from None
    placed = [*zip(items.mission, route, strict=True), *zip(items.rally, rally, strict=True)]
    _check_places(Fence(shapes), placed, site)
    steps: list[tuple[str, tuple[float, ...], Sequence[Any]]] = [
        ("mission_upload", (), route),
        ("fence_upload", (), shapes),
        ("rally_upload", (), rally),
        ("mission", (), ()),
        ("arm", (0.0, READY_TIMEOUT), ()),
        ("finish", (), ()),
    ]
    commands = [
        OperatorCommand(kind, SOURCE, number, values, "", tuple(item_values))
        for number, (kind, values, item_values) in enumerate(steps, start=1)
    ]
    return Plan(tuple(commands), (*notes(items.mission), *items.notes, *_end_in_flight(items.mission, route)))


def _end_in_flight(items: Sequence[PlanItem], route: Sequence[Any]) -> Iterator[str]:
    """Yield a note if the flight does not end with a landing, so that the run does not end with it."""
    stay = next((item for item, flown in zip(items, route, strict=True) if flown.action == "loiter"), None)
    if stay is not None or ends_in_the_air(route):
        where = f"{label(stay)}: stays there" if stay else "no landing at the end: the vehicle stays in the air"
        yield f"{where} until run.duration or Ctrl-C"


def _check_places(fence: Fence, items: Sequence[tuple[PlanItem, Any]], site: Site) -> None:
    """Raise ValueError if the fence forbids the start or a position, or a position is below the ground."""
    x, y = site.start
    if breach := fence.breach(x, y):
        raise ValueError(f"geoFence: the start at x = {x:g} m, y = {y:g} m is {breach}; move the fence or home")
    for item, converted in items:
        if breach := breach_of(fence, converted):
            raise ValueError(f"{label(item)}: {breach}; move the item or the fence")
        x, y, z = converted.position
        if converted.action not in ("land", "takeoff") and has_place(converted) and z < (height := site.ground(x, y)):
            raise ValueError(f"{label(item)}: {height - z:.3g} m below the ground; raise its altitude")


HEADER = "QGC WPL"
VERSION = "110"
_COLUMNS = 12
_HOME = 16, 0  # command and frame of the row that is home


def read_rows(text: str) -> PlanItems:
    """Return the items of a .waypoints file's content. Raise ValueError (one line) for another content."""
    first, *lines = text.splitlines()
    if first.removeprefix(HEADER).strip() != VERSION:
        raise ValueError(f"{first}: unknown version; expected {HEADER} {VERSION}")
    rows = [line.split() for line in lines if line.strip() and not line.startswith("#")]
    items, has_home = [], False
    for number, row in enumerate(rows):
        with entry(f"row {number}"):
            if len(row) != _COLUMNS:
                raise ValueError(f"expected {_COLUMNS} columns, got {len(row)}")
            index, _, frame, command = (int(float(value)) for value in row[:4])
            a, b, c, d, latitude, longitude, altitude = map(float, row[4:11])
            if number == 0 and (command, frame) == _HOME:
                has_home = True
                continue
            shown = number if has_home else number + 1
            place = latitude, longitude, altitude
            items.append(PlanItem(shown, index, command, frame, (a, b, c, d), *place, float(row[11]) != 0.0))
    return PlanItems(items, [], [], has_home)
