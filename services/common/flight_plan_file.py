"""Import of QGroundControl missions: .plan (JSON) and .waypoints (QGC WPL 110).

Sources: MAVLink guide, "File formats"; QGroundControl developer guide, "Plan file format". Positions are relative to
the scene's home. Altitudes of frame 3 are above the resting vehicle, those of frame 0 above sea level.
"""

import json
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from lapwing.dynamics.environment import STANDARD
from lapwing.dynamics.geodesy import Home, geodetic_to_enu
from lapwing.dynamics.input_file import read_text, unreadable
from lapwing.messages import MissionItem, OperatorCommand, Vector3

OPERATED = ["autopilot.accept_commands=true", "autopilot.follow_trajectory=false"]  # scene overrides for flying a plan
READY_TIMEOUT = 60.0  # [s] for the vehicle to become ready for take-off
SOURCE = "plan"
HEADER = "QGC WPL 110"
EXPECTED = "expected a mission saved by a ground station"
_ABOVE_SEA, _ABOVE_HOME, _NO_PLACE = (0, 5), (3, 6), 2  # MAV_FRAME

_Params = Sequence[float]
_ACTIONS: dict[int, tuple[str, Callable[[_Params], dict[str, Any]]]] = {  # by MAV_CMD
    16: (
        "waypoint",
        lambda p: {"hold_time": _zero(p[0]), "radius": p[1] if p[1] > 0.0 else math.nan, "yaw": _yaw(p[3])},
    ),
    19: ("loiter_time", lambda p: {"hold_time": _zero(p[0])}),
    20: ("return", lambda p: {}),
    21: ("land", lambda p: {"yaw": _yaw(p[3])}),
    22: ("takeoff", lambda p: {"yaw": _yaw(p[3])}),
    93: ("delay", lambda p: {"hold_time": _zero(p[0])}),
    112: ("delay", lambda p: {"hold_time": _zero(p[0])}),
    115: ("yaw", lambda p: {"yaw": _yaw(p[0])}),
    177: ("jump", lambda p: {"values": (p[0], p[1])}),
    178: ("speed", lambda p: {"values": (p[1],)}),
}


class _Datum(NamedTuple):
    """Origin of positions in a plan."""

    home: Home
    ground: float  # [m] world z of the resting vehicle


def read(path: Path, standing_height: float = 0.0, home: Home = STANDARD.home) -> list[OperatorCommand]:
    """Return the commands that upload a plan, fly it, and end the run after landing.

    Args:
        path: file.
        standing_height: world z [m] of the resting vehicle, the origin of altitudes above home.
        home: origin of the world frame.

    Raises:
        ValueError: (one line) the file is missing, has another format, or contains an unsupported item.
    """
    try:
        text = read_text(path)
    except OSError as error:
        raise unreadable(path, error, "a mission file (.plan, .waypoints)") from None
    except UnicodeDecodeError:
        raise ValueError(f"{path}: not a UTF-8 text file; expected a .plan or .waypoints file") from None
    return parse(path, text, standing_height, home)


def parse(path: Path, text: str, standing_height: float = 0.0, home: Home = STANDARD.home) -> list[OperatorCommand]:
    """Return the commands that upload the plan with this content. See `read` for arguments and errors."""
    datum = _Datum(home, standing_height)
    try:
        if text.startswith(HEADER):
            items, fence, rally = _waypoints(text, datum)
        else:
            items, fence, rally = _plan(json.loads(text), datum)
    except KeyError as error:
        raise ValueError(f"{path}: not a plan: key {error} is missing; {EXPECTED}") from None
    except (TypeError, IndexError, AttributeError, OverflowError):
        raise ValueError(f"{path}: not a plan: an entry has the wrong type or length; {EXPECTED}") from None
    except RecursionError:
        raise ValueError(f"{path}: not a plan: nested too deeply") from None
    except json.JSONDecodeError as error:
        raise ValueError(f"{path}: neither JSON (.plan) nor {HEADER} (.waypoints): {error}") from None
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    if not items:
        raise ValueError(f"{path}: contains no mission item")

    steps: list[tuple[str, tuple[float, ...], Sequence[Any]]] = [
        ("mission_upload", (), items),
        ("fence_upload", (), fence),
        ("rally_upload", (), rally),
        ("mission", (), ()),
        ("arm", (0.0, READY_TIMEOUT), ()),
        ("finish", (), ()),
    ]
    return [
        OperatorCommand(kind, SOURCE, number, values, "", tuple(item_values))
        for number, (kind, values, item_values) in enumerate(steps, start=1)
    ]


def _waypoints(text: str, datum: _Datum) -> tuple[list[Any], list[Any], list[Any]]:
    rows = [line.split() for line in text.splitlines()[1:] if line.strip()]
    items = []
    for number, row in enumerate(rows):
        with _entry(f"item {number}"):
            if len(row) != 12:
                raise ValueError(f"expected 12 columns, got {len(row)}")
            place = [float(v) for v in row[8:11]]
            if number == 0 and row[3] == "16" and row[2] == "0":
                continue  # the first row is home by convention
            items.append(_item(int(row[3]), int(row[2]), [float(v) for v in row[4:8]], place, datum))
    return [_jump_back(item, len(rows) - len(items)) for item in items], [], []


def _jump_back(item: Any, skipped: int) -> Any:
    """Renumber a jump, whose target counts the home row."""
    return item._replace(values=(item.values[0] - skipped, item.values[1])) if item.action == "jump" else item


def _plan(data: dict, datum: _Datum) -> tuple[list[Any], list[Any], list[Any]]:
    if data.get("fileType") != "Plan":
        raise ValueError('expected "fileType": "Plan"')
    items, numbers = [], {}
    for number, raw in enumerate(data["mission"]["items"]):
        with _entry(f"item {number}"):
            if raw.get("type") != "SimpleItem":
                raise ValueError(f"expected a SimpleItem, got {raw.get('type')}")
            params = [math.nan if v is None else float(v) for v in raw["params"]]
            numbers[raw.get("doJumpId", number + 1)] = number
            items.append(_item(raw["command"], raw["frame"], params[:4], params[4:7], datum))
    for number, item in enumerate(items):
        if item.action == "jump":
            target, times = item.values
            if target not in numbers:
                raise ValueError(f"item {number}: jumps to {target:g}, which no item has as doJumpId")
            items[number] = item._replace(values=(float(numbers[target]), times))
    with _entry("geoFence"):
        shapes = _fence(data.get("geoFence", {}), datum)
    with _entry("rallyPoints"):
        points = data.get("rallyPoints", {}).get("points", ())
        rally = [_item_of(datum, "rally", x, y, datum.ground + z) for x, y, z in points]
    return items, shapes, rally


@contextmanager
def _entry(where: str) -> Iterator[None]:
    """Prefix the ValueError about an entry's content with its name."""
    try:
        yield
    except KeyError as error:
        raise ValueError(f"{where}: key {error} is missing; {EXPECTED}") from None
    except (TypeError, IndexError, AttributeError, OverflowError):
        raise ValueError(f"{where}: wrong type or length; {EXPECTED}") from None
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from None


def _fence(fence: dict, datum: _Datum) -> list[Any]:
    """Return the items of a geofence's circles and polygons."""
    shapes = [_item_of(datum, "fence_circle_in" if c["inclusion"] else "fence_circle_out", *c["circle"]["center"],
                       radius=float(c["circle"]["radius"])) for c in fence.get("circles", ())]  # fmt: skip
    for polygon in fence.get("polygons", ()):
        action = "fence_inclusion" if polygon["inclusion"] else "fence_exclusion"
        count = (float(len(polygon["polygon"])),)
        shapes += [_item_of(datum, action, *corner, values=count) for corner in polygon["polygon"]]
    return shapes


def _item(command: int, frame: int, params: list[float], place: list[float], datum: _Datum) -> Any:
    if command not in _ACTIONS:
        raise ValueError(f"unknown command {command}; known: {', '.join(map(str, _ACTIONS))}")
    if frame not in (*_ABOVE_SEA, *_ABOVE_HOME, _NO_PLACE):
        raise ValueError(f"unknown frame {frame}; expected 0, 2 or 3")
    action, fields = _ACTIONS[command]
    latitude, longitude, height = place
    if not (abs(latitude) <= 90.0 and abs(longitude) <= 180.0) and action == "waypoint":
        raise ValueError(f"expected a latitude and a longitude, got {latitude:g}, {longitude:g}")
    if frame in _ABOVE_SEA:
        height -= datum.home.height
    else:
        height += datum.ground
    if action in ("waypoint", "land", "takeoff", "loiter_time"):
        return _item_of(datum, action, latitude, longitude, height, **fields(params))
    return _mission_item(action, (math.nan,) * 3, **fields(params))


def _item_of(datum: _Datum, action: str, latitude: float, longitude: float, height: float = 0.0, **fields: Any) -> Any:
    """Return an item at a geodetic position and a world z of `height` [m]; NaN without a position."""
    if math.isnan(latitude) or (latitude, longitude) == (0.0, 0.0):
        return _mission_item(action, (math.nan, math.nan, height), **fields)
    x, y, _ = geodetic_to_enu(datum.home, float(latitude), float(longitude), datum.home.height + height)
    return _mission_item(action, (x, y, height), **fields)


def _mission_item(action: str, place: tuple[float, float, float], **fields: Any) -> Any:
    item = MissionItem(action, Vector3(*place), math.nan, math.nan, 0.0, ())
    return item._replace(**fields)


def _zero(value: float) -> float:
    return 0.0 if math.isnan(value) else value


def _yaw(heading_deg: float) -> float:
    """Return the world yaw [rad] of a heading [deg]."""
    return math.nan if math.isnan(heading_deg) else math.remainder(0.5 * math.pi - math.radians(heading_deg), math.tau)
