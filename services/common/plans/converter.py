"""Conversion of a plan's items into a route of the autopilot, a geofence or rally points.

An item without effect on this vehicle (cameras, gimbals, servos) becomes a delay of zero length, so that item numbers
are unchanged; `notes` lists them.
"""

import math
from collections.abc import Sequence
from typing import Any

from lapwing.services.common.mavlink.geo_coordinates import Datum
from lapwing.services.common.plans import command_table
from lapwing.services.common.plans.item_converters import CONVERTERS, changes_ground_speed, idle
from lapwing.services.common.plans.plan_item import (
    INVALID,
    INVALID_PARAM1,
    MISSION,
    UNSUPPORTED,
    PlanItem,
    RefusedItemError,
)
from lapwing.services.common.plans.route_checks import check_items

_SPLINE, _JUMP, _CHANGE_SPEED = 82, 177, 178  # MAV_CMD
_LISTED = 4  # item numbers in a note


def label(item: PlanItem) -> str:
    """Return number and name of an item for messages."""
    return item.entry or f"item {item.number}, {command_table.name(item.command)}"


def convert(items: Sequence[PlanItem], kind: int, datum: Datum, ardupilot: bool = False) -> list[Any]:
    """Return the autopilot's items.

    Args:
        items: all items of a list, in order.
        kind: MISSION, FENCE or RALLY.
        datum: reference of coordinates.
        ardupilot: True for ArduPilot's missions: headings of positions are 0 and mean nothing, since its copters turn
            by CONDITION_YAW only, and `continues` is ignored.

    Raises:
        RefusedItemError: an item cannot be flown, or the route has no end.
    """
    try:
        result = [_convert(index, item, kind, datum) for index, item in enumerate(items)]
        if kind == MISSION:
            if not ardupilot:
                _check_stops(items)
            else:
                result = [i if i.action == "yaw" else i._replace(yaw=math.nan) for i in result]
            result = _with_jump_targets(items, result)
            check_items(result)
    except RefusedItemError as error:
        raise refusal(items, error) from None
    return result


def refusal(items: Sequence[PlanItem], error: RefusedItemError) -> RefusedItemError:
    """Return an error about a converted item with the number and name of its source."""
    return RefusedItemError(error.result, error.text, error.index, label(items[error.index]))


def notes(items: Sequence[PlanItem]) -> list[str]:
    """Return one line for each kind of items that are skipped, or flown in another way."""
    numbers: dict[tuple[str, str], list[int]] = {}
    for item in items:
        if (text := _note(item)) and item.number:
            numbers.setdefault((command_table.name(item.command), text), []).append(item.number)
    return [f"{_listed(found)}, {name}: {text}" for (name, text), found in numbers.items()]


def _note(item: PlanItem) -> str:
    if item.command in command_table.SKIPPED:
        return f"skipped, {command_table.SKIPPED[item.command][1]}"
    if item.command == _SPLINE:
        return "flown along straight legs"
    if item.command == _CHANGE_SPEED and item.params[0] > 1.0 and not changes_ground_speed(item):
        return "skipped, climb and descent speed are MPC_Z_VEL_MAX_UP and MPC_Z_VEL_MAX_DN"
    return ""


def _listed(numbers: Sequence[int]) -> str:
    text = ", ".join(map(str, numbers[:_LISTED]))
    rest = f" and {len(numbers) - _LISTED} more" if len(numbers) > _LISTED else ""
    return f"item{'s' if len(numbers) > 1 else ''} {text}{rest}"


def _convert(index: int, item: PlanItem, kind: int, datum: Datum) -> Any:
    if kind == MISSION and item.number == 0:
        return idle()
    converter = CONVERTERS[kind].get(item.command)
    try:
        if converter is None:
            return _without_converter(item, kind)
        if any(map(math.isinf, (*item.params, item.latitude, item.longitude, item.altitude))):
            raise RefusedItemError(INVALID, "a parameter is infinite; expected finite numbers")
        return converter(item, datum)
    except RefusedItemError as error:
        raise RefusedItemError(error.result, error.text, index) from None


def _without_converter(item: PlanItem, kind: int) -> Any:
    if kind != MISSION:
        raise RefusedItemError(UNSUPPORTED, "not part of a geofence or of rally points; use a mission")
    if item.command in command_table.SKIPPED:
        return idle()
    if item.command in command_table.FLOWN:
        raise RefusedItemError(UNSUPPORTED, "not part of a mission; use the list of the geofence or of rally points")
    _, reason = command_table.REFUSED.get(item.command, ("", "not flown; remove it"))
    raise RefusedItemError(UNSUPPORTED, reason)


def _check_stops(items: Sequence[PlanItem]) -> None:
    """Raise RefusedItemError for an item, except the last, after which nobody would continue the mission."""
    for index, item in enumerate(items[:-1]):
        if not item.continues and item.number:
            raise RefusedItemError(INVALID, "the mission would stop there; set its autocontinue to true", index)


def _with_jump_targets(items: Sequence[PlanItem], route: Sequence[Any]) -> list[Any]:
    """Return the route whose jumps name positions in the list instead of numbers of the plan."""
    indices: dict[float, list[int]] = {}
    for index, item in enumerate(items):
        indices.setdefault(float(item.jump_id), []).append(index)
    result = list(route)
    for index, item in enumerate(items):
        if item.command == _JUMP and item.number:
            target, times = route[index].values
            targets = indices.get(target, [])
            if len(targets) != 1:
                problem = "several items have" if targets else "no item has"
                text = f"jumps to {target:g}, which {problem} as its number; jump to the number of one item"
                raise RefusedItemError(INVALID_PARAM1, text, index)
            result[index] = route[index]._replace(values=(float(targets[0]), times))
    return result
