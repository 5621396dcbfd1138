"""Reading of QGroundControl's .plan files (JSON).

Format: QGroundControl developer guide, "Plan file format". An item's `frame` is the reference of its altitude, as in
the messages that QGroundControl sends; its AltitudeMode belongs to the editor. `plannedHomePosition` is not used: home
is where the vehicle starts.
"""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

from lapwing.services.common.plans.plan_item import PlanItem

EXPECTED = "expected a mission saved by a ground station"
ARDUPILOT = 3  # MAV_AUTOPILOT_ARDUPILOTMEGA
_TRANSECTS = "TransectStyleComplexItem"
_RELATIVE = 3  # MAV_FRAME_GLOBAL_RELATIVE_ALT
_INSIDE, _OUTSIDE, _CIRCLE_IN, _CIRCLE_OUT, _RALLY = 5001, 5002, 5003, 5004, 5100  # MAV_CMD
_NONE = (0.0, 0.0, 0.0)
_FENCE_KEYS = ("version", "polygons", "circles", "polygon", "breachReturn")


class PlanItems(NamedTuple):
    """Items of a file."""

    mission: list[PlanItem]
    fence: list[PlanItem]
    rally: list[PlanItem]
    ardupilot: bool  # True for the conventions of ArduPilot's missions
    notes: tuple[str, ...] = ()  # parts of the file that are not used


@contextmanager
def entry(where: str) -> Iterator[None]:
    """Prefix the error about an entry's content with its name."""
    try:
        yield
    except KeyError as error:
        raise ValueError(f"{where}: key {error} is missing; {EXPECTED}") from None
    except (TypeError, IndexError, AttributeError, OverflowError):
        raise ValueError(f"{where}: wrong type or length; {EXPECTED}") from None
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from None


def read_json(data: dict[str, Any]) -> PlanItems:
    """Return the items of a .plan file's content. Raise ValueError, KeyError or TypeError for another content."""
    if data.get("fileType") != "Plan":
        raise ValueError(f'expected "fileType": "Plan", got {data.get("fileType")!r}; save the plan in QGroundControl')
    mission = data["mission"]
    raws = [raw for number, item in enumerate(mission["items"], start=1) for raw in _simple_items(number, item)]
    items = []
    for number, raw in enumerate(raws, start=1):
        with entry(f"item {number}"):
            items.append(_simple_item(number, raw))
    fence = data.get("geoFence") or {}
    with entry("geoFence"):
        if unknown := sorted(key for key, value in fence.items() if value and key not in _FENCE_KEYS):
            raise ValueError(f"unknown key {unknown[0]}; expected polygons and circles")
        shapes = _shapes(fence)
        used = ("breachReturn",) if any(_number(v) for v in fence.get("breachReturn") or ()) else ()
    rally = []
    for number, point in enumerate((data.get("rallyPoints") or {}).get("points") or ()):
        with entry(f"rallyPoints.points[{number}]"):
            latitude, longitude, altitude = (_number(point[k]) for k in range(3))
            rally.append(_placed(_RALLY, latitude, longitude, f"rallyPoints.points[{number}]", altitude=altitude))
    notes = tuple(f"geoFence.{key}: not used, a return goes home or to a rally point" for key in used)
    return PlanItems(items, shapes, rally, mission.get("firmwareType") == ARDUPILOT, notes)


def _simple_items(number: int, raw: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the simple items of an item: itself, or those that QGroundControl has computed for a survey."""
    with entry(f"item {number}"):
        kind = raw.get("type")
        if kind == "SimpleItem":
            return [raw]
        if kind != "ComplexItem":
            raise ValueError(f"unknown type {kind}; expected SimpleItem or ComplexItem")
        name = raw.get("complexItemType")
        if name in ("fwLandingPattern", "vtolLandingPattern"):
            raise ValueError(f"{name}: not for multirotors; use NAV_LAND or NAV_RETURN_TO_LAUNCH")
        items: list[dict[str, Any]] = (raw.get(_TRANSECTS) or {}).get("Items") or []
        if not items:
            raise ValueError(f"{name}: the file has no waypoints of it ({_TRANSECTS}.Items); use waypoints instead")
        return items


def _simple_item(number: int, raw: dict[str, Any]) -> PlanItem:
    params = [*raw["params"]]
    if "coordinate" in raw:  # first version of the format
        params = [*params[:4], *raw["coordinate"]]
    if len(params) != 7:
        raise ValueError(f"expected 7 params, got {len(params)}")
    a, b, c, d, latitude, longitude, altitude = map(_number, params)
    return PlanItem(
        number,
        number if raw.get("doJumpId") is None else _whole(raw["doJumpId"], "doJumpId"),
        _whole(raw["command"], "command"),
        _whole(raw["frame"], "frame"),
        (a, b, c, d),
        latitude,
        longitude,
        altitude,
        raw.get("autoContinue", True) is not False,
    )


def _number(value: Any) -> float:
    """Return a number of the file; NaN for null."""
    return math.nan if value is None else float(value)


def _whole(value: Any, name: str) -> int:
    number = float(value)
    if number != int(number):
        raise ValueError(f"{name} {value}; expected a whole number")
    return int(number)


def _placed(command: int, latitude: Any, longitude: Any, where: str, first: float = 0.0, altitude: float = 0.0) -> Any:
    place = _number(latitude), _number(longitude), altitude
    return PlanItem(0, -1, command, _RELATIVE, (first, *_NONE), *place, entry=where)


def _shapes(fence: dict[str, Any]) -> list[PlanItem]:
    """Return the items of a geofence's circles and polygons."""
    result = []
    for number, circle in enumerate(fence.get("circles") or ()):
        where = f"geoFence.circles[{number}]"
        with entry(f"circles[{number}]"):
            latitude, longitude, *_ = circle["circle"]["center"]
            command = _CIRCLE_IN if circle["inclusion"] else _CIRCLE_OUT
            result.append(_placed(command, latitude, longitude, where, _number(circle["circle"]["radius"])))
    polygons = [*(fence.get("polygons") or ())]
    if fence.get("polygon"):  # first version of the format
        polygons.append({"inclusion": True, "polygon": fence["polygon"]})
    for number, polygon in enumerate(polygons):
        with entry(f"polygons[{number}]"):
            command, corners = _INSIDE if polygon["inclusion"] else _OUTSIDE, polygon["polygon"]
            if not corners:
                raise ValueError("a polygon without corners; expected at least 3")
            where, count = f"geoFence.polygons[{number}]", float(len(corners))
            result += [_placed(command, latitude, longitude, where, count) for latitude, longitude, *_ in corners]
    return result
