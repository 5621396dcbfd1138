"""Import of flight plans."""

import json
import math
from pathlib import Path

import pytest

from lapwing.services.common.mavlink.geo_coordinates import Datum
from lapwing.services.common.plans.command_table import FLOWN, REFUSED, SKIPPED, name
from lapwing.services.common.plans.item_converters import CONVERTERS
from lapwing.services.common.plans.plan_file import ORIGIN, read
from lapwing.services.common.plans.plan_item import FENCE, MISSION, RALLY

DELIVERY = Path("lapwing/scenes/plans/delivery.plan")


def items(path, site=ORIGIN):
    return read(path, site).commands[0].items


def test_delivery_plan_has_mission_items():
    result = items(DELIVERY)
    assert [i.action for i in result] == ["speed", "takeoff", *["waypoint"] * 4, "land"]
    assert tuple(result[4].position) == pytest.approx((10.0, 10.0, 10.0), abs=1e-3)
    assert result[4].yaw == pytest.approx(0.0)  # heading east
    assert result[5].yaw == pytest.approx(math.pi / 2)  # heading north
    assert result[5].hold_time == 5.0


def test_plan_altitudes_start_at_resting_height():
    result = items(DELIVERY, ORIGIN._replace(datum=Datum(home_z=0.35, standing_height=0.35)))
    assert [i.position.z for i in result[1:6]] == pytest.approx([10.35] * 5, abs=1e-3)


def test_waypoints_skip_home_and_renumber_jumps(tmp_path):
    path = tmp_path / "a.waypoints"
    rows = [
        "QGC WPL 110",
        "0 1 0 16 0 0 0 0 40.7686 14.7907 280 1",
        "1 0 3 22 0 0 0 nan 40.7686 14.7907 5 1",
        "2 0 3 16 2 0 0 nan 40.7687 14.7907 5 1",
        "3 0 2 177 2 1 0 0 0 0 0 1",
    ]
    path.write_text("\n".join(rows))
    result = items(path)
    assert [i.action for i in result] == ["takeoff", "waypoint", "jump"]
    assert result[1].position.y == pytest.approx(11.1, abs=0.1)
    assert result[1].position.z == pytest.approx(5.0, abs=1e-4)
    assert result[2].values == (1.0, 1.0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("nothing", "neither JSON"),
        ("{}", "fileType"),
        ('{"fileType": "Plan"}', "not a plan"),
        ("QGC WPL 110\n0 1 3 16 0 0", "expected 12 columns, got 6"),
        ("QGC WPL 110\n0 1 3 999 0 0 0 0 1 1 1 1", "item 1, command 999: not flown"),
        ("QGC WPL 110\n0 1 3 16 a 0 0 0 1 1 1 1", "row 0: could not convert string to float: 'a'"),
    ],
)
def test_invalid_plan_is_rejected_in_one_line(tmp_path, text, message):
    path = tmp_path / "bad.plan"
    path.write_text(text)
    with pytest.raises(ValueError, match=message) as caught:
        read(path)
    assert "\n" not in str(caught.value)


SIMPLE = {"type": "SimpleItem", "command": 16, "frame": 3, "params": [0, 0, 0, None, 40.7686, 14.7907, 5.0]}
FAR = SIMPLE | {"params": [0, 0, 0, None, 40.8686, 14.7907, 5.0]}
HOME = SIMPLE | {"command": 179, "params": [0, 0, 0, 0, 41.7686, 14.7907, 0.0]}
JUMP = SIMPLE | {"command": 177, "frame": 2, "params": [7, 1, 0, 0, 0, 0, 0]}


def circle_around(latitude):
    return {"circles": [{"inclusion": True, "circle": {"center": [latitude, 14.7907], "radius": 100.0}}]}


@pytest.mark.parametrize(
    ("mission", "others", "message"),
    [
        ([SIMPLE, {k: v for k, v in SIMPLE.items() if k != "params"}], {}, "item 2: key 'params' is missing"),
        ([SIMPLE, SIMPLE | {"params": ["a"] * 7}], {}, "item 2: could not convert string to float: 'a'"),
        ([SIMPLE, SIMPLE | {"params": [0, 0]}], {}, "item 2: expected 7 params, got 2"),
        ([SIMPLE, 3], {}, "item 2: wrong type or length"),
        ([SIMPLE, JUMP], {}, "item 2, DO_JUMP: jumps to 7"),
        ([SIMPLE], {"geoFence": 3}, "geoFence: wrong type or length"),
        ([SIMPLE, SIMPLE | {"autoContinue": False}, SIMPLE], {}, "item 2, NAV_WAYPOINT: the mission would stop there"),
        ([SIMPLE | {"doJumpId": 7}, SIMPLE | {"doJumpId": 7}, JUMP], {}, "item 3, DO_JUMP: jumps to 7, which several"),
        ([SIMPLE, SIMPLE | {"command": 16.5}], {}, "item 2: command 16.5; expected a whole number"),
        ([SIMPLE | {"type": "ComplexItem", "complexItemType": "StructureScan"}], {}, "item 1: StructureScan: the file"),
        ([SIMPLE | {"type": "ComplexItem", "complexItemType": "vtolLandingPattern"}], {}, "not for multirotors"),
        ([SIMPLE | {"type": "Item"}], {}, "item 1: unknown type Item"),
        ([], {}, "contains no mission item; add a take-off"),
        ([FAR], {}, r"item 1, NAV_WAYPOINT: 111\d\d m from the start; expected at most 10000 m"),
        (
            [SIMPLE],
            {"geoFence": circle_around(40.0)},
            "geoFence: the start at x = 0 m, y = 0 m is outside of the geofence",
        ),
        ([SIMPLE, FAR], {"geoFence": circle_around(40.7686)}, "item 2, NAV_WAYPOINT: outside of the geofence"),
        ([SIMPLE], {"geoFence": {"polygons": [{"inclusion": True, "polygon": []}]}}, "a polygon without corners"),
        ([SIMPLE], {"geoFence": {"polygon": [[0.0, 0.0]] * 2}}, "a polygon of 2 corners"),
        (
            [SIMPLE],
            {"geoFence": {"circle": {"radius": 9.0}}},
            "geoFence: unknown key circle; expected polygons and circl",
        ),
        (
            [SIMPLE],
            {"geoFence": circle_around(40.7686), "rallyPoints": {"points": [[40.78, 14.8, 9.0]]}},
            r"rallyPoints.points\[0\]: outside of the geofence",
        ),
        ([SIMPLE], {"rallyPoints": {"points": [{"coordinate": [1, 2, 3]}]}}, r"rallyPoints.points\[0\]: key 0 is miss"),
        ([SIMPLE, HOME], {}, "item 2, DO_SET_HOME: 111 km from home"),
        ([SIMPLE | {"params": [0, 0, 0, None, 40.7686, 14.7907, -2.0]}], {}, "item 1, NAV_WAYPOINT: 2 m below the gro"),
        (
            [SIMPLE | {"command": 18, "params": [1, 0, 9, 0, 40.7686, 14.7907, -2.0]}],
            {},
            "item 1, NAV_LOITER_TURNS: alt",
        ),
        (
            [SIMPLE | {"command": 18, "params": [1, 0, 101, 0, 40.7686, 14.7907, 5.0]}],
            {"geoFence": circle_around(40.7686)},
            "item 1, NAV_LOITER_TURNS: outside of the geofence",
        ),
        ([SIMPLE], {"rallyPoints": {"points": [1]}}, r"rallyPoints.points\[0\]: wrong type or length"),
    ],
)
def test_error_names_entry_of_plan(tmp_path, mission, others, message):
    path = tmp_path / "bad.plan"
    path.write_text(json.dumps({"fileType": "Plan", "mission": {"items": mission}, **others}))
    limit = 10000.0 if FAR in mission[:1] else 0.0
    with pytest.raises(ValueError, match=message) as caught:
        read(path, ORIGIN._replace(first_limit=limit, ground=lambda x, y: 0.0))
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


def write(path, mission, **others):
    path.write_text("\ufeff" + json.dumps({"fileType": "Plan", "mission": mission, **others}), encoding="utf-8")
    return path


@pytest.mark.parametrize("home", [{}, {"plannedHomePosition": None}, {"plannedHomePosition": [0, 0, 0]}])
def test_plan_without_home_flies_from_where_vehicle_starts(tmp_path, home):
    optional = {"geoFence": None, "rallyPoints": {"points": []}}
    result = items(write(tmp_path / "a.plan", {"items": [SIMPLE], **home}, **optional))
    assert tuple(result[0].position) == pytest.approx((0.0, 0.0, 5.0), abs=1e-6)


def test_numbers_as_text_and_first_format_are_read(tmp_path):
    text = SIMPLE | {"command": "16", "frame": 3.0, "params": ["1", "0.5", 0, "nan", "40.7686", "14.7907", "5"]}
    first = {k: v for k, v in SIMPLE.items() if k != "params"} | {
        "params": [2, 0, 0, None],
        "coordinate": [40.7686, 14.7907, 6],
    }
    result = items(write(tmp_path / "a.plan", {"items": [text, first]}))
    assert [(i.hold_time, i.position.z) for i in result] == [(1.0, pytest.approx(5.0)), (2.0, pytest.approx(6.0))]


@pytest.mark.parametrize("kind", ["survey", "CorridorScan"])
def test_waypoints_of_surveys_are_flown(tmp_path, kind):
    inside = [SIMPLE | {"doJumpId": 2}, SIMPLE | {"command": 206, "frame": 2, "doJumpId": 3}, SIMPLE | {"doJumpId": 4}]
    survey = {"type": "ComplexItem", "complexItemType": kind, "TransectStyleComplexItem": {"Items": inside}}
    jump = JUMP | {"doJumpId": 5, "params": [4, 1, 0, 0, 0, 0, 0]}
    plan = read(write(tmp_path / "a.plan", {"items": [SIMPLE | {"doJumpId": 1}, survey, jump]}))
    assert [i.action for i in plan.commands[0].items] == ["waypoint", "waypoint", "delay", "waypoint", "jump"]
    assert plan.commands[0].items[4].values == (3.0, 1.0)
    assert plan.notes[:-1] == ("item 3, DO_SET_CAM_TRIGG_DIST: skipped, the vehicle has no camera",)


def test_guide_lists_commands():
    page = Path("docs/guides/missions.md").read_text()
    names = [*map(name, (*FLOWN, *SKIPPED, *REFUSED))]
    assert [text for text in names if text not in page] == []
    assert CONVERTERS[MISSION].keys() | CONVERTERS[FENCE].keys() | CONVERTERS[RALLY].keys() == FLOWN.keys() | {208}
