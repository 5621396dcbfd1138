"""Checks of a route: every route that reaches the autopilot passes them, of whichever door."""

from collections.abc import Sequence
from typing import Any

from lapwing.kernels import math
from lapwing.services.common.plans.plan_item import (
    DENIED,
    INVALID,
    INVALID_PARAM1,
    INVALID_PARAM2,
    INVALID_PARAM7,
    INVALID_SEQUENCE,
    UNSUPPORTED,
    RefusedItemError,
)

TO_PLACES = ("waypoint", "loiter_time", "loiter", "loiter_to_alt")  # actions at a position
ORBIT = "orbit"  # circle around a position; values: angle [rad], positive to the left, speed [m/s], yaw behaviour
INSTANT = ("speed", "roi", "set_home", "gripper")  # actions that take no time
ACTIONS = (*TO_PLACES, ORBIT, *INSTANT, "takeoff", "land", "return", "delay", "condition", "jump", "yaw")

MAXIMUM_TAKEOFF_HEIGHT = 1000.0  # [m]
CORNERS = 72  # of a circle for checks
LEAST_RADIUS, ORBIT_RADIUS, MOST_RADIUS = 1.0, 10.0, 1000.0  # [m] of a circle; by default the second
MAXIMUM_DISTANCE = 1e5  # [m] from the origin of the world frame, a plane that the Earth leaves by 0.8 km there


def check_items(items: Sequence[Any]) -> None:
    """Raise RefusedItemError for the first invalid item, or for jumps that would never end."""
    for index, item in enumerate(items):
        if problem := _problem(item, len(items)):
            raise RefusedItemError(*problem, index)
    endless = _endless_jump(items)
    if endless is not None:
        raise RefusedItemError(INVALID_SEQUENCE, "jumps in a circle without a waypoint; jump to a waypoint", endless)


def _problem(item: Any, count: int) -> tuple[int, str] | None:
    """Return the MAV_MISSION_RESULT and the reason why an item is invalid, None if it is valid."""
    action, place, values = item.action, item.position, item.values
    if action not in ACTIONS:
        return UNSUPPORTED, f"unknown action {action}; expected one of {', '.join(ACTIONS)}"
    if action == "waypoint" and not all(map(math.isfinite, place)):
        return INVALID, f"{action} needs a position; expected finite x, y, z"
    if action == "takeoff" and MAXIMUM_TAKEOFF_HEIGHT < place.z < math.inf:
        return INVALID_PARAM7, f"take-off to {place.z:g} m; expected at most {MAXIMUM_TAKEOFF_HEIGHT:g} m"
    depth = 0.0 if math.isnan(place.z) else place.z  # of the far side of the Earth, below the world frame's plane
    distance = math.sqrt(place.x * place.x + place.y * place.y + depth * depth)
    if (has_place(item) or action == "set_home") and distance > MAXIMUM_DISTANCE:
        return INVALID, f"{1e-3 * distance:.0f} km from home; expected at most {1e-3 * MAXIMUM_DISTANCE:g} km"
    if math.isinf(item.yaw) or not (math.isfinite(item.hold_time) and item.hold_time >= 0.0):
        return INVALID, "expected a finite yaw, and a time of 0 s or more"
    if action == "jump" and not (len(values) > 1 and 0 <= values[0] < count):
        return INVALID_PARAM1, f"expected a jump to an item from 1 to {count}, and a number of repetitions"
    if action == "jump" and not 0.0 <= values[1] < math.inf:
        return INVALID_PARAM2, f"{values[1]:g} repetitions; expected a finite number"
    if action == "speed" and not (values and (0.0 < values[0] < math.inf or math.isnan(values[0]))):
        return INVALID_PARAM2, "expected a speed above 0 m/s, or NaN for that of the parameters"
    if action == ORBIT and not LEAST_RADIUS <= item.radius <= MOST_RADIUS:
        return INVALID, f"radius {item.radius:g} m; expected {LEAST_RADIUS:g} to {MOST_RADIUS:g} m"
    if action == ORBIT and (len(values) < 3 or any(map(math.isinf, values)) or not abs(values[0]) > 0.0):
        return INVALID_PARAM1, "circles for ever; expected a number of turns above 0"
    if action == ORBIT and values[1] <= 0.0:
        return INVALID_PARAM2, f"speed {values[1]:g} m/s; expected more than 0, or NaN for the horizontal speed"
    return None


def has_place(item: Any) -> bool:
    """Return True if an item names a horizontal position of the vehicle."""
    flown = item.action in (*TO_PLACES, ORBIT, "takeoff", "land")
    return flown and math.isfinite(item.position.x) and math.isfinite(item.position.y)


def breach_of(fence: Any, item: Any) -> str:
    """Return the fence's breach by the position of an item, or a part of its circle; "" if it is allowed."""
    if not (has_place(item) or item.action == "rally"):
        return ""
    (x, y, _), radius = item.position, item.radius if item.action == ORBIT else 0.0
    angles = [math.tau * k / CORNERS for k in range(CORNERS if radius else 1)]
    breaches = (fence.breach(x + radius * math.cos(a), y + radius * math.sin(a)) for a in angles)
    return next(filter(None, breaches), "")


def ends_in_the_air(items: Sequence[Any]) -> bool:
    """Return True if the last item that takes time is no landing."""
    lasting = [item.action for item in items if not is_instant(item)]
    return not (lasting and lasting[-1] in ("land", "return"))


def check_first_place(items: Sequence[Any], start: Sequence[float], limit: float) -> None:
    """Raise RefusedItemError if the first position is too far from the start.

    Args:
        items: items of a mission.
        start: world x, y of the vehicle [m].
        limit: maximum horizontal distance [m] (MIS_DIST_1WP); 0 or less: any distance.
    """
    first = next((index for index, item in enumerate(items) if has_place(item)), None)
    if first is None or limit <= 0.0:
        return
    east, north = items[first].position.x - start[0], items[first].position.y - start[1]
    distance = math.sqrt(east * east + north * north)
    if distance > limit:
        text = f"{distance:.0f} m from the start; expected at most {limit:g} m (MIS_DIST_1WP)"
        raise RefusedItemError(DENIED, text, first)


def _endless_jump(items: Sequence[Any]) -> int | None:
    """Return the index of a backward jump in a circle of items that take no time, None without one.

    A used-up jump leads to the next item, so a jump has two successors. Items without a predecessor or without a
    successor are removed until circles remain, each item and successor once.
    """
    count = len(items)
    after: dict[int, set[int]] = {}
    for index, item in enumerate(items):
        if is_instant(item) or item.action == "jump":
            jumps = item.action == "jump" and item.values[1] >= 1.0
            after[index] = {index + 1, *([int(item.values[0])] if jumps else [])}
    before: dict[int, set[int]] = {index: set() for index in after}
    for index, successors in after.items():
        successors.intersection_update(after)
        for successor in successors:
            before[successor].add(index)
    for inward, outward in ((before, after), (after, before)):
        ends = [index for index in inward if not inward[index]]
        for _ in range(count):
            if not ends:
                break
            end = ends.pop()
            for neighbour in outward.pop(end):
                inward[neighbour].discard(end)
                if not inward[neighbour]:
                    ends.append(neighbour)
            del inward[end]
    back = (i for i in sorted(after) if items[i].action == "jump" and items[i].values[0] <= i)
    return next(back, None)


def is_instant(item: Any) -> bool:
    """Return True if an item takes no time; skipped ones of a plan are zero delays."""
    return item.action in INSTANT or (item.action == "delay" and item.hold_time == 0.0)
