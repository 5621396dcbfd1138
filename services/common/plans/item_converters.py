"""Conversion of each command that is flown (MAV_CMD) into the autopilot's item.

Meaning of the parameters: MAVLink's common.xml. What it leaves open is as in PX4.
"""

import math
from collections.abc import Callable
from typing import Any

from lapwing.messages import MissionItem, Vector3
from lapwing.services.common.mavlink.frames import swap_yaw
from lapwing.services.common.mavlink.geo_coordinates import ABOVE_HOME, ABOVE_SEA, Datum, to_world
from lapwing.services.common.plans.plan_item import (
    FENCE,
    INVALID_PARAM1,
    INVALID_PARAM2,
    INVALID_PARAM4,
    INVALID_PARAM5,
    INVALID_PARAM6,
    INVALID_PARAM7,
    MISSION,
    RALLY,
    UNSUPPORTED_FRAME,
    PlanItem,
    RefusedItemError,
)
from lapwing.services.common.plans.route_checks import ORBIT_RADIUS

MAX_ITEMS = 1000
_NO_POSITION, _TERRAIN = 2, (10, 11)  # MAV_FRAME_MISSION; GLOBAL_TERRAIN_ALT and its INT variant
_HIGHEST = 1e5  # [m]
_AIRSPEED, _GROUND_SPEED, _CLIMB_SPEED, _DESCENT_SPEED = range(4)  # SPEED_TYPE
NO_CHANGE, DEFAULT_SPEED = -1.0, -2.0  # speeds of DO_CHANGE_SPEED
_RELEASE_PARACHUTE = 2.0  # PARACHUTE_ACTION
_ROI_LOCATION = 3  # MAV_ROI
_ORIGIN, _UNSET = Vector3(), Vector3(math.nan, math.nan, math.nan)


def new_item(
    action: str,
    place: Any = _ORIGIN,
    yaw: float = math.nan,
    radius: float = math.nan,
    hold_time: float = 0.0,
    values: tuple[float, ...] = (),
) -> Any:
    """Return an item of the autopilot; see MissionItem.msg for the fields."""
    return MissionItem(action, place, yaw, radius, hold_time, values)


def idle() -> Any:
    """Return an item without effect or duration."""
    return new_item("delay")


def _position(item: PlanItem, datum: Datum, required: bool = True) -> Any:
    """Return the position of an item; NaN for coordinates that are optional and not specified."""
    latitude, longitude, altitude = item.latitude, item.longitude, item.altitude
    if not required and (latitude, longitude) == (0.0, 0.0):
        latitude = longitude = math.nan
    unspecified = math.isnan(latitude) and math.isnan(longitude)
    if item.frame == _NO_POSITION and not required and unspecified and not abs(altitude) > 0.0:
        return _UNSET
    if item.frame not in ABOVE_SEA | ABOVE_HOME:
        reason = "altitudes above terrain" if item.frame in _TERRAIN else "its positions"
        raise RefusedItemError(
            UNSUPPORTED_FRAME, f"frame {item.frame}: {reason} are not flown; use frame 3 (above home) or 0 (above sea)"
        )
    for name, value, other, limit, result in (
        ("latitude", latitude, longitude, 90.0, INVALID_PARAM5),
        ("longitude", longitude, latitude, 180.0, INVALID_PARAM6),
    ):
        if abs(value) > limit:
            raise RefusedItemError(result, f"{name} {value:g}; expected degrees from {-limit:g} to {limit:g}")
        if math.isnan(value) and (required or not math.isnan(other)):
            raise RefusedItemError(result, f"no {name}; expected degrees from {-limit:g} to {limit:g}")
    if abs(altitude) > _HIGHEST or (required and math.isnan(altitude)):
        problem = "no altitude" if math.isnan(altitude) else f"altitude {altitude:g} m"
        raise RefusedItemError(INVALID_PARAM7, f"{problem}; expected metres above home (frame 3) or above sea (0)")
    return Vector3(*to_world(datum, item.frame, latitude, longitude, altitude))


def _non_negative(value: float, name: str, result: int = INVALID_PARAM1) -> float:
    """Return a time or number that must not be negative; 0 if it is not specified."""
    if value < 0.0:
        raise RefusedItemError(result, f"{name} {value:g}; expected 0 or more")
    return 0.0 if math.isnan(value) else value


def _yaw(heading_deg: float) -> float:
    """Return the world yaw [rad] of a heading [deg]."""
    return swap_yaw(math.radians(heading_deg))


def _waypoint(item: PlanItem, datum: Datum) -> Any:
    hold_time, acceptance, _, heading = item.params
    radius = acceptance if acceptance > 0.0 else math.nan
    return new_item("waypoint", _position(item, datum), _yaw(heading), radius, _non_negative(hold_time, "hold time"))


def _takeoff(item: PlanItem, datum: Datum) -> Any:
    place = _position(item, datum, required=False)
    if item.frame != _NO_POSITION:  # the vehicle climbs where it stands
        place = place._replace(z=to_world(datum, item.frame, math.nan, math.nan, item.altitude)[2])
    if place.z <= datum.home_z:
        raise _too_low(place, datum)
    return new_item("takeoff", place, _yaw(item.params[3]))


def _too_low(place: Any, datum: Datum) -> RefusedItemError:
    text = f"altitude {place.z - datum.home_z:.4g} m above home; expected more than 0 m (frame 0 is above sea level)"
    return RefusedItemError(INVALID_PARAM7, text)


def _land(item: PlanItem, datum: Datum) -> Any:
    if item.params[1] == 2.0:
        raise RefusedItemError(INVALID_PARAM2, "requires precision landing, which does not exist; use 0 or 1")
    return new_item("land", _position(item, datum, required=False), _yaw(item.params[3]))


def _loiter(item: PlanItem, datum: Datum) -> Any:
    return new_item("loiter", _position(item, datum, required=False), _yaw(item.params[3]))


def _loiter_time(item: PlanItem, datum: Datum) -> Any:
    place, hold_time = _position(item, datum, required=False), _non_negative(item.params[0], "time")
    return new_item("loiter_time", place, _yaw(item.params[3]), hold_time=hold_time)


def _loiter_turns(item: PlanItem, datum: Datum) -> Any:
    turns, _, radius, _ = item.params
    return _orbit(item, datum, math.tau * _non_negative(turns, "turns"), radius, math.nan, math.nan)


def _do_orbit(item: PlanItem, datum: Datum) -> Any:
    radius, speed, behaviour, angle = item.params
    return _orbit(item, datum, _non_negative(angle, "angle", INVALID_PARAM4), radius, speed, behaviour)


def _orbit(item: PlanItem, datum: Datum, angle: float, radius: float, speed: float, behaviour: float) -> Any:
    """Return a circle, clockwise for a positive radius and speed; the angle [rad] is not negative."""
    radius = radius if abs(radius) > 0.0 else ORBIT_RADIUS
    place, left = _position(item, datum, required=False), -math.copysign(1.0, radius)
    left *= math.copysign(1.0, speed) if speed == speed else 1.0
    if place.z <= datum.home_z:
        raise _too_low(place, datum)
    return new_item("orbit", place, radius=abs(radius), values=(left * angle, abs(speed), behaviour))


def _loiter_to_alt(item: PlanItem, datum: Datum) -> Any:
    place = _position(item, datum, required=False)
    if math.isnan(place.z):
        raise RefusedItemError(INVALID_PARAM7, "no altitude; expected metres above home (frame 3) or above sea (0)")
    return new_item("loiter_to_alt", place)


def _delay(item: PlanItem, datum: Datum) -> Any:
    delay, *time_of_day = item.params
    if not delay > 0.0 and any(value > 0.0 for value in time_of_day):
        raise RefusedItemError(INVALID_PARAM1, "waits for a time of day, which a simulated flight lacks; use a delay")
    return new_item("delay", hold_time=_non_negative(delay, "delay"))


def _set_home(item: PlanItem, datum: Datum) -> Any:
    if item.params[0] == 1.0:  # the vehicle's position at that time
        return new_item("set_home", _UNSET)
    x, y, z = _position(item, datum)
    return new_item("set_home", Vector3(x, y, z - datum.standing_height))


def _turn(item: PlanItem, datum: Datum) -> Any:
    angle, _, direction, relative = item.params
    if math.isnan(angle):
        raise RefusedItemError(INVALID_PARAM1, "no angle; expected degrees")
    if direction not in (-1.0, 0.0, 1.0):
        direction = 0.0  # NaN: not specified
    if relative == 1.0:  # to the present heading; clockwise unless the direction is -1
        return new_item("yaw", yaw=math.radians(angle if direction == -1.0 else -angle), values=(1.0,))
    values = (0.0, -direction) if direction else ()  # world yaw is counterclockwise
    return new_item("yaw", yaw=_yaw(angle), values=values)


def _speed(item: PlanItem, datum: Datum) -> Any:
    kind, speed = item.params[:2]
    if kind not in (_AIRSPEED, _GROUND_SPEED, _CLIMB_SPEED, _DESCENT_SPEED):
        raise RefusedItemError(INVALID_PARAM1, f"speed type {kind:g}; expected 1 (ground speed)")
    if not (speed > 0.0 or speed in (NO_CHANGE, DEFAULT_SPEED) or math.isnan(speed)):
        raise RefusedItemError(
            INVALID_PARAM2, f"speed {speed:g} m/s; expected more than 0, -1 (no change) or -2 (default)"
        )
    if not changes_ground_speed(item):
        return idle()
    return new_item("speed", values=(math.nan if speed == DEFAULT_SPEED else speed,))


def changes_ground_speed(item: PlanItem) -> bool:
    """Return True if a DO_CHANGE_SPEED has an effect on the horizontal speed."""
    kind, speed = item.params[:2]
    return kind in (_AIRSPEED, _GROUND_SPEED) and not (speed == NO_CHANGE or math.isnan(speed))


def _jump(item: PlanItem, datum: Datum) -> Any:
    """Return a jump to the `jump_id` of an item."""
    target, times = item.params[:2]
    if times < 0.0:
        raise RefusedItemError(INVALID_PARAM2, f"repeats for ever ({times:g}); expected a number of repetitions")
    return new_item("jump", values=(_non_negative(target, "item"), float(int(_non_negative(times, "repetitions")))))


def _condition_delay(item: PlanItem, datum: Datum) -> Any:
    return new_item("condition", hold_time=_non_negative(item.params[0], "delay"))


def _condition_distance(item: PlanItem, datum: Datum) -> Any:
    return new_item("condition", radius=_non_negative(item.params[0], "distance"))


def _roi(item: PlanItem, datum: Datum) -> Any:
    return new_item("roi", _position(item, datum))


def _no_roi(item: PlanItem, datum: Datum) -> Any:
    return new_item("roi", _UNSET)


def _roi_by_mode(item: PlanItem, datum: Datum) -> Any:
    mode = item.params[0]
    named = mode == 0.0 and (abs(item.latitude) > 0.0 or abs(item.longitude) > 0.0)  # as in Mission Planner
    return (_roi if named or mode == _ROI_LOCATION else _no_roi)(item, datum)


def _gripper(item: PlanItem, datum: Datum) -> Any:
    if item.params[1] not in (0.0, 1.0):
        raise RefusedItemError(INVALID_PARAM2, f"action {item.params[1]:g}; expected 0 (release) or 1 (grab)")
    return new_item("gripper", values=(item.params[1],))


def _parachute(item: PlanItem, datum: Datum) -> Any:
    if item.params[0] == _RELEASE_PARACHUTE:
        raise RefusedItemError(INVALID_PARAM1, "releases a parachute, which the vehicle lacks; use NAV_LAND")
    return idle()


def _circle(action: str) -> "Converter":
    def convert(item: PlanItem, datum: Datum) -> Any:
        radius = item.params[0]
        if not radius > 0.0:
            raise RefusedItemError(INVALID_PARAM1, f"radius {radius:g} m; expected more than 0")
        x, y, _ = _position(item._replace(altitude=0.0), datum)
        return new_item(action, Vector3(x, y, 0.0), radius=radius, values=(radius,))

    return convert


def _vertex(action: str) -> "Converter":
    def convert(item: PlanItem, datum: Datum) -> Any:
        count = item.params[0]
        if not 3.0 <= count <= MAX_ITEMS:
            raise RefusedItemError(INVALID_PARAM1, f"a polygon of {count:g} corners; expected 3 to {MAX_ITEMS}")
        x, y, _ = _position(item._replace(altitude=0.0), datum)
        return new_item(action, Vector3(x, y, 0.0), values=(float(int(count)),))

    return convert


Converter = Callable[[PlanItem, Datum], Any]
CONVERTERS: dict[int, dict[int, Converter]] = {
    MISSION: {
        16: _waypoint,
        17: _loiter,
        18: _loiter_turns,
        19: _loiter_time,
        20: lambda item, datum: new_item("return"),
        21: _land,
        22: _takeoff,
        31: _loiter_to_alt,
        34: _do_orbit,
        80: _roi_by_mode,
        82: _waypoint,
        93: _delay,
        112: _condition_delay,
        114: _condition_distance,
        115: _turn,
        177: _jump,
        178: _speed,
        179: _set_home,
        195: _roi,
        197: _no_roi,
        201: _roi_by_mode,
        208: _parachute,
        211: _gripper,
    },
    FENCE: {
        5001: _vertex("fence_inclusion"),
        5002: _vertex("fence_exclusion"),
        5003: _circle("fence_circle_in"),
        5004: _circle("fence_circle_out"),
    },
    RALLY: {5100: lambda item, datum: new_item("rally", _position(item, datum))},
}
"""Conversion function by kind of list (MAV_MISSION_TYPE) and MAV_CMD."""
