"""Import of flight plans."""

import json
import math
from pathlib import Path

import pytest

from lapwing.services.common.flight_plan_file import read

DELIVERY = Path("lapwing/scenes/plans/delivery.plan")


def items(path):
    return read(path)[0].items


def test_delivery_plan_has_mission_items():
    result = items(DELIVERY)
    assert [i.action for i in result] == ["speed", "takeoff", *["waypoint"] * 4, "land"]
    assert tuple(result[4].position) == pytest.approx((10.0, 10.0, 10.0), abs=1e-3)
    assert result[4].yaw == pytest.approx(0.0)  # heading east
    assert result[5].yaw == pytest.approx(math.pi / 2)  # heading north
    assert result[5].hold_time == 5.0


def test_plan_altitudes_start_at_resting_height():
    result = read(DELIVERY, 0.35)[0].items
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
    assert result[1].position.z == 5.0
    assert result[2].values == (1.0, 1.0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("nothing", "neither JSON"),
        ("{}", "fileType"),
        ('{"fileType": "Plan"}', "not a plan"),
        ("QGC WPL 110\n0 1 3 16 0 0", "expected 12 columns, got 6"),
        ("QGC WPL 110\n0 1 3 999 0 0 0 0 1 1 1 1", "item 0: unknown command 999"),
        ("QGC WPL 110\n0 1 3 16 a 0 0 0 1 1 1 1", "item 0: could not convert string to float: 'a'"),
    ],
)
def test_invalid_plan_is_rejected_in_one_line(tmp_path, text, message):
    path = tmp_path / "bad.plan"
    path.write_text(text)
    with pytest.raises(ValueError, match=message) as caught:
        read(path)
    assert "\n" not in str(caught.value)


SIMPLE = {"type": "SimpleItem", "command": 16, "frame": 3, "params": [0, 0, 0, None, 40.7686, 14.7907, 5.0]}
JUMP = SIMPLE | {"command": 177, "frame": 2, "params": [7, 1, 0, 0, 0, 0, 0]}


@pytest.mark.parametrize(
    ("mission", "others", "message"),
    [
        ([SIMPLE, {k: v for k, v in SIMPLE.items() if k != "params"}], {}, "item 1: key 'params' is missing"),
        ([SIMPLE, SIMPLE | {"params": ["a"] * 7}], {}, "item 1: could not convert string to float: 'a'"),
        ([SIMPLE, SIMPLE | {"params": [0, 0]}], {}, "item 1: not enough values"),
        ([SIMPLE, 3], {}, "item 1: wrong type or length"),
        ([SIMPLE, JUMP], {}, "item 1: jumps to 7"),
        ([SIMPLE], {"geoFence": 3}, "geoFence: wrong type or length"),
        ([SIMPLE], {"rallyPoints": {"points": [1]}}, "rallyPoints: wrong type or length"),
    ],
)
def test_error_names_entry_of_plan(tmp_path, mission, others, message):
    path = tmp_path / "bad.plan"
    path.write_text(json.dumps({"fileType": "Plan", "mission": {"items": mission}, **others}))
    with pytest.raises(ValueError, match=message) as caught:
        read(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)
