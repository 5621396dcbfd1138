"""Plans through both doors: the same items in a file and in an upload are the same route, or refused alike."""

import json
import math

import pytest
from adapter_harness import Bench

from lapwing.dynamics.geodesy import Home, enu_to_geodetic, geodetic_to_enu
from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.common.mavlink.geo_coordinates import Datum
from lapwing.services.common.plans.plan_file import Site, read

NAN = math.nan
HOME = Home()
HERE = (40.7687, 14.7908)
REST = 0.35  # [m] body origin of the resting vehicle
SITE = Site(Datum(HOME, REST, REST), (0.0, 0.0), 10000.0)
NO_SPEED, NO_HEIGHT = (1, -1, -1, 0, 0, 0, 0), (0, 0, 0, None, *HERE, None)


def nav(command, *params, frame=3, place=HERE, altitude=30.0):
    return command, frame, (*params, *[0.0] * (4 - len(params)), *place, altitude)


def do(command, *params):
    return command, 2, (*params, *[0.0] * (7 - len(params)))


WAYPOINT = nav(16, 0.0, 0.0, 0.0, None)


def write_plan(tmp_path, items, firmware=12, **more):
    raws = [
        {
            "type": "SimpleItem",
            "command": command,
            "frame": frame,
            "doJumpId": k,
            "autoContinue": True,
            "params": params,
        }
        for k, (command, frame, params) in enumerate(items, start=1)
    ]
    path = tmp_path / "a.plan"
    path.write_text(json.dumps({"fileType": "Plan", "mission": {"firmwareType": firmware, "items": raws}, **more}))
    return path


def write_waypoints(tmp_path, items):
    home = [0, 1, 0, 16, 0, 0, 0, 0, HOME.latitude_deg, HOME.longitude_deg, HOME.height, 1]
    rows = [[k, 0, frame, command, *params, 1] for k, (command, frame, params) in enumerate(items, start=1)]
    path = tmp_path / "a.waypoints"
    lines = ["\t".join("nan" if v is None else str(v) for v in row) for row in (home, *rows)]
    path.write_text("\r\n".join(["QGC WPL 110", *lines, ""]))
    return path


def upload(items, *overrides, kind=0):
    """Upload items, whose numbers of jumps are those of the messages. Return the station and the vehicle's items."""
    bench = Bench(*overrides)
    station = bench.station()
    station.send("mission_count", 1, 1, len(items), kind)
    for seq, (command, frame, params) in enumerate(items):
        a, b, c, d, latitude, longitude, altitude = (NAN if v is None else v for v in params)
        place = round(latitude * 1e7), round(longitude * 1e7), altitude
        station.send("mission_item_int", 1, 1, seq, frame, command, 0, 1, a, b, c, d, *place, kind)
    bench.step(3)
    return station, bench.vehicle.items


def messages_of(items):
    """Return items whose jumps name messages, from 0, instead of items of a file, from 1."""
    return [(c, f, (p[0] - 1, *p[1:])) if c == 177 else (c, f, p) for c, f, p in items]


def assert_same_route(one, other):
    assert [i.action for i in one] == [i.action for i in other]
    for a, b in zip(one, other, strict=True):
        assert tuple(a.position) == pytest.approx(tuple(b.position), abs=0.02, nan_ok=True), a.action
        for name in ("yaw", "radius", "hold_time", "values"):
            assert getattr(a, name) == pytest.approx(getattr(b, name), abs=1e-6, nan_ok=True), (a.action, name)


FLOWN = {  # items after a take-off, and the autopilot's action, yaw, radius, hold time and values
    "waypoint": (nav(16, 2.0, 1.5, 0.0, 90.0), ("waypoint", 0.0, 1.5, 2.0, ())),
    "waypoint with negative radius": (nav(16, 0.0, -1.0, 0.0, None), ("waypoint", NAN, NAN, 0.0, ())),
    "spline": (nav(82, 0.0, 0.0, 0.0, None), ("waypoint", NAN, NAN, 0.0, ())),
    "loiter": (nav(17, 0.0, 0.0, 0.0, None), ("loiter", NAN, NAN, 0.0, ())),
    "loiter for a time": (nav(19, 7.0, 0.0, 0.0, None), ("loiter_time", NAN, NAN, 7.0, ())),
    "loiter to altitude": (nav(31, 0.0, 0.0, 0.0, None), ("loiter_to_alt", NAN, NAN, 0.0, ())),
    "land": (nav(21, 0.0, 0.0, 0.0, 0.0), ("land", 0.5 * math.pi, NAN, 0.0, ())),
    "land here": (do(21, 0.0, 0.0, 0.0, None), ("land", NAN, NAN, 0.0, ())),
    "return": (do(20), ("return", NAN, NAN, 0.0, ())),
    "delay": (do(93, 4.0, -1.0, -1.0, -1.0), ("delay", NAN, NAN, 4.0, ())),
    "ground speed": (do(178, 1, 3.0, -1), ("speed", NAN, NAN, 0.0, (3.0,))),
    "airspeed": (do(178, 0, 3.0, -1), ("speed", NAN, NAN, 0.0, (3.0,))),
    "climb speed": (do(178, 2, 3.0, -1), ("delay", NAN, NAN, 0.0, ())),
    "descent speed": (do(178, 3, 0.5, -1), ("delay", NAN, NAN, 0.0, ())),
    "turns to the right": (nav(18, 2.0, 0.0, 9.0), ("orbit", NAN, 9.0, 0.0, (-4.0 * math.pi, NAN, NAN))),
    "turns to the left": (nav(18, 0.5, 0.0, -9.0), ("orbit", NAN, 9.0, 0.0, (math.pi, NAN, NAN))),
    "turns without radius": (nav(18, 1.0), ("orbit", NAN, 10.0, 0.0, (-2.0 * math.pi, NAN, NAN))),
    "orbit": (nav(34, 9.0, 2.0, 3.0, 1.5), ("orbit", NAN, 9.0, 0.0, (-1.5, 2.0, 3.0))),
    "orbit to the left": (nav(34, -9.0, 2.0, 0.0, 1.5), ("orbit", NAN, 9.0, 0.0, (1.5, 2.0, 0.0))),
    "orbit backwards": (nav(34, -9.0, -2.0, 0.0, 1.5), ("orbit", NAN, 9.0, 0.0, (-1.5, 2.0, 0.0))),
    "speed unchanged": (do(178, 1, -1.0, -1), ("delay", NAN, NAN, 0.0, ())),
    "default speed": (do(178, 1, -2.0, -1), ("speed", NAN, NAN, 0.0, (NAN,))),
    "absolute yaw": (do(115, 90.0, 0.0, 0.0, 0.0), ("yaw", 0.0, NAN, 0.0, ())),
    "yaw to the right": (do(115, 0.0, 0.0, 1.0, 0.0), ("yaw", 0.5 * math.pi, NAN, 0.0, (0.0, -1.0))),
    "relative yaw": (do(115, 30.0, 0.0, 1.0, 1.0), ("yaw", -math.pi / 6.0, NAN, 0.0, (1.0,))),
    "relative yaw to the left": (do(115, 30.0, 0.0, -1.0, 1.0), ("yaw", math.pi / 6.0, NAN, 0.0, (1.0,))),
    "condition of a delay": (do(112, 5.0), ("condition", NAN, NAN, 5.0, ())),
    "condition of a distance": (do(114, 8.0), ("condition", NAN, 8.0, 0.0, ())),
    "jump": (do(177, 1, 2), ("jump", NAN, NAN, 0.0, (0.0, 2.0))),
    "jump forwards": (do(177, 3, 1), ("jump", NAN, NAN, 0.0, (2.0, 1.0))),
    "region of interest": (nav(195), ("roi", NAN, NAN, 0.0, ())),
    "no region of interest": (do(197), ("roi", NAN, NAN, 0.0, ())),
    "home here": (do(179, 1.0), ("set_home", NAN, NAN, 0.0, ())),
    "gripper": (do(211, 1.0, 0.0), ("gripper", NAN, NAN, 0.0, (0.0,))),
    "camera": (do(2000, 0.0, 1.0), ("delay", NAN, NAN, 0.0, ())),
    "servo": (do(183, 1.0, 1500.0), ("delay", NAN, NAN, 0.0, ())),
    "landing sequence": (do(189), ("delay", NAN, NAN, 0.0, ())),
}


@pytest.mark.parametrize(("command", "expected"), FLOWN.values(), ids=FLOWN)
def test_item_is_same_route_from_file_and_link(tmp_path, command, expected):
    items = [nav(22, 0.0, 0.0, 0.0, None), command, WAYPOINT]
    from_file = read(write_plan(tmp_path, items), SITE).commands[0].items
    station, from_link = upload(messages_of(items))
    assert station.last("MISSION_ACK").type == mavlink.MAV_MISSION_ACCEPTED
    assert_same_route(from_file, from_link)
    action, yaw, radius, hold_time, values = expected
    item = from_file[1]
    assert item.action == action
    assert (item.yaw, item.radius, item.hold_time) == pytest.approx((yaw, radius, hold_time), nan_ok=True)
    assert item.values == pytest.approx(values, nan_ok=True)


def test_missions_of_ardupilot_are_same_from_file_and_link(tmp_path):
    """ArduPilot's first item is home, its headings mean nothing, and jumps count from home."""
    items = [nav(22), nav(16), do(115, 90.0), do(177, 2, 1), nav(21, place=(0.0, 0.0), altitude=0.0)]
    home = 16, 0, (0, 0, 0, 0, HOME.latitude_deg, HOME.longitude_deg, HOME.height)
    _, (first, *from_link) = upload([home, *items], "mavlink.firmware=ardupilot")
    assert first.action == "delay"
    from_link[3] = from_link[3]._replace(values=(1.0, 1.0))  # without home
    for path in (write_waypoints(tmp_path, items), write_plan(tmp_path, items, firmware=3)):
        assert_same_route(read(path, SITE).commands[0].items, from_link)
    assert [i.yaw for i in from_link] == pytest.approx([NAN, NAN, 0.0, NAN, NAN], nan_ok=True)


@pytest.mark.parametrize("distance", [5e3, 20e3])
@pytest.mark.parametrize(("frame", "altitude"), [(3, 30.0), (6, 30.0), (0, 310.0), (5, 310.0)])
def test_altitude_follows_curvature_of_earth(tmp_path, distance, frame, altitude):
    """Reference: the item's geodetic height by the inverse conversion."""
    latitude, longitude, _ = enu_to_geodetic(HOME, (distance, 0.0, 0.0))
    far = nav(16, 0, 0, 0, None, frame=frame, place=(latitude, longitude), altitude=altitude)
    from_file = read(write_plan(tmp_path, [far]), SITE._replace(first_limit=0.0)).commands[0].items
    _, from_link = upload([far])
    assert_same_route(from_file, from_link)
    height = enu_to_geodetic(HOME, tuple(from_file[0].position))[2] - HOME.height
    assert height == pytest.approx(30.0 + (REST if frame in (3, 6) else 0.0), abs=1e-6)


def test_plan_crosses_meridian_of_180_degrees(tmp_path):
    home = Home(-17.0, 179.9999, 0.0)
    path = write_plan(tmp_path, [nav(16, 0, 0, 0, None, place=(-17.0, -179.9999))])
    item = read(path, SITE._replace(datum=Datum(home, REST, REST))).commands[0].items[0]
    assert tuple(item.position)[:2] == pytest.approx((21.3, 0.0), abs=0.1)
    assert geodetic_to_enu(home, -17.0, -179.9999, 0.0)[0] == pytest.approx(item.position.x, abs=1e-3)


REFUSED = {  # items, text, MAV_MISSION_RESULT
    "vertical take-off": ([nav(84)], "item 1, NAV_VTOL_TAKEOFF: not for multirotors; use NAV_TAKEOFF", "UNSUPPORTED"),
    "no turns": ([WAYPOINT, nav(18, 0.0, 0.0, 9.0)], "item 2, NAV_LOITER_TURNS: circles for ever", "INVALID_PARAM1"),
    "endless orbit": ([nav(34, 9.0, 2.0, 0.0, 0.0)], "item 1, DO_ORBIT: circles for ever", "INVALID_PARAM1"),
    "orbit backwards in time": ([nav(34, 9.0, 2.0, 0.0, -6.0)], "item 1, DO_ORBIT: angle -6", "INVALID_PARAM4"),
    "small orbit": ([nav(34, 0.5, 2.0, 0.0, 6.0)], "item 1, DO_ORBIT: radius 0.5 m; expected 1 to 1000", "INVALID"),
    "orbit at rest": ([nav(34, 9.0, 0.0, 0.0, 6.0)], "item 1, DO_ORBIT: speed 0 m/s", "INVALID_PARAM2"),
    "guided": ([do(92, 1)], "item 1, NAV_GUIDED_ENABLE: no external computer", "UNSUPPORTED"),
    "unknown": ([do(999)], "item 1, command 999: not flown; remove it", "UNSUPPORTED"),
    "fence in mission": ([nav(5003, 9.0)], "item 1, NAV_FENCE_CIRCLE_INCLUSION: not part of a mission", "UNSUPPORTED"),
    "terrain": ([nav(16, frame=10)], "item 1, NAV_WAYPOINT: frame 10: altitudes above terrain", "UNSUPPORTED_FRAME"),
    "local frame": ([nav(16, frame=1)], "item 1, NAV_WAYPOINT: frame 1: its positions are not", "UNSUPPORTED_FRAME"),
    "take-off in no frame": ([nav(22, frame=2)], "NAV_TAKEOFF: frame 2: its positions are not", "UNSUPPORTED_FRAME"),
    "no altitude": ([WAYPOINT, (16, 3, NO_HEIGHT)], "item 2, NAV_WAYPOINT: no altitude", "INVALID_PARAM7"),
    "low take-off": ([nav(22, frame=0)], "NAV_TAKEOFF: altitude -250", "INVALID_PARAM7"),
    "high take-off": ([nav(22, altitude=2000.0)], "NAV_TAKEOFF: take-off to 2000", "INVALID_PARAM7"),
    "landing off the Earth": ([nav(21, place=(91.0, 14.8))], "item 1, NAV_LAND: latitude 91;", "INVALID_PARAM5_X"),
    "take-off off the Earth": ([nav(22, place=(40.0, 190.0))], "NAV_TAKEOFF: longitude 190;", "INVALID_PARAM6_Y"),
    "landing far away": ([WAYPOINT, nav(21, place=(0.0, 14.8))], "item 2, NAV_LAND: 4", "INVALID"),
    "other side": ([WAYPOINT, nav(16, place=(-40.7686, -165.2093))], "NAV_WAYPOINT: 127", "INVALID"),
    "precision landing": ([nav(21, 0.0, 2.0)], "NAV_LAND: requires precision landing", "INVALID_PARAM2"),
    "negative hold time": ([nav(16, -1.0)], "NAV_WAYPOINT: hold time -1", "INVALID_PARAM1"),
    "time of day": ([do(93, -1.0, 12.0, 0.0, 0.0)], "NAV_DELAY: waits for a time of day", "INVALID_PARAM1"),
    "speed 0": ([do(178, 1, 0.0)], "DO_CHANGE_SPEED: speed 0 m/s; expected more than 0", "INVALID_PARAM2"),
    "negative speed": ([do(178, 1, -3.0)], "DO_CHANGE_SPEED: speed -3 m/s", "INVALID_PARAM2"),
    "unknown speed": ([do(178, 7, 3.0)], "DO_CHANGE_SPEED: speed type 7", "INVALID_PARAM1"),
    "endless jump": ([WAYPOINT, do(177, 1, -1)], "item 2, DO_JUMP: repeats for ever", "INVALID_PARAM2"),
    "jump to nowhere": ([WAYPOINT, do(177, 9, 1)], "item 2, DO_JUMP: jumps to [89], which no", "INVALID_PARAM1"),
    "jump to itself": ([WAYPOINT, do(177, 2, 1e9)], "item 2, DO_JUMP: jumps in a circle", "INVALID_SEQUENCE"),
    "mutual jumps": ([WAYPOINT, do(177, 3, 9), do(177, 2, 9)], "item 3, DO_JUMP: jumps in", "INVALID_SEQUENCE"),
    "jump over speeds": ([WAYPOINT, do(178, 1, 2.0), do(177, 2, 9)], "item 3, DO_JUMP: jumps in", "INVALID_SEQUENCE"),
    "used-up jump": (
        [do(178, 1, 2.0), do(177, 5, 1), do(178, 1, 3.0), do(177, 1, 9), WAYPOINT],
        "item 4, DO_JUMP: jumps in a circle", "INVALID_SEQUENCE",
    ),
    "no angle": ([do(115, None)], "item 1, CONDITION_YAW: no angle", "INVALID_PARAM1"),
}  # fmt: skip


@pytest.mark.parametrize(("items", "text", "result"), REFUSED.values(), ids=REFUSED)
def test_refusal_is_same_from_file_and_link(tmp_path, items, text, result):
    with pytest.raises(ValueError, match=text) as caught:
        read(write_plan(tmp_path, items), SITE)
    assert str(caught.value).startswith(f"{tmp_path / 'a.plan'}: item ")
    assert "\n" not in str(caught.value)
    station, from_link = upload(messages_of(items))
    assert not from_link
    assert station.last("MISSION_ACK").type == getattr(mavlink, f"MAV_MISSION_{result}")
    said = "".join(m.text for m in station.all("STATUSTEXT"))
    assert said.startswith("Upload rejected: item ")
    if items[-1][0] != 177:  # numbers of jumps differ
        assert said.removeprefix("Upload rejected: ") in str(caught.value)


FENCES = {  # part of a file, messages, text, MAV_MISSION_RESULT
    "two corners": (
        {"polygons": [{"inclusion": True, "polygon": [[40.0, 14.0], [41.0, 15.0]]}]},
        [nav(5001, 2.0)] * 2, "a polygon of 2 corners; expected 3 to 1000", "INVALID_PARAM1",
    ),
    "no radius": (
        {"circles": [{"inclusion": False, "circle": {"center": HERE, "radius": 0}}]},
        [nav(5004, 0.0)], "radius 0 m; expected more than 0", "INVALID_PARAM1",
    ),
    "negative radius": (
        {"circles": [{"inclusion": True, "circle": {"center": HERE, "radius": -5.0}}]},
        [nav(5003, -5.0)], "radius -5 m; expected more than 0", "INVALID_PARAM1",
    ),
    "corner off the Earth": (
        {"polygons": [{"inclusion": False, "polygon": [[99.0, 14.0], HERE, HERE]}]},
        [nav(5002, 3.0, place=(99.0, 14.0))] * 3, "latitude 99; expected", "INVALID_PARAM5_X",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("fence", "items", "text", "result"), FENCES.values(), ids=FENCES)
def test_invalid_fence_is_refused_from_file_and_link(tmp_path, fence, items, text, result):
    with pytest.raises(ValueError, match=rf"a.plan: geoFence\..*\[0\]: {text}"):
        read(write_plan(tmp_path, [WAYPOINT], geoFence=fence), SITE)
    station, _ = upload(items, kind=1)
    assert station.last("MISSION_ACK").type == getattr(mavlink, f"MAV_MISSION_{result}")
    assert text in "".join(m.text for m in station.all("STATUSTEXT"))


@pytest.mark.parametrize(
    ("last", "note"),
    [
        (nav(17), ("item 2, NAV_LOITER_UNLIM: stays there until run.duration or Ctrl-C",)),
        (do(197), ("no landing at the end: the vehicle stays in the air until run.duration or Ctrl-C",)),
        (do(20), ()),
    ],
)
def test_flight_without_landing_is_noted(tmp_path, last, note):
    assert read(write_plan(tmp_path, [WAYPOINT, last]), SITE).notes == note


def test_skipped_items_are_named_once_for_each_kind(tmp_path):
    items = [WAYPOINT, *[do(2000)] * 6, nav(82), do(178, 2, 1.0)]
    plan = read(write_plan(tmp_path, items), SITE)
    assert plan.notes[:-1] == (
        "items 2, 3, 4, 5 and 2 more, IMAGE_START_CAPTURE: skipped, the vehicle has no camera",
        "item 8, NAV_SPLINE_WAYPOINT: flown along straight legs",
        "item 9, DO_CHANGE_SPEED: skipped, climb and descent speed are MPC_Z_VEL_MAX_UP and MPC_Z_VEL_MAX_DN",
    )
    station, _ = upload(items)
    assert "".join(m.text for m in station.all("STATUSTEXT")) == "".join(plan.notes[:-1])
