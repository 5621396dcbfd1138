"""CSV files of points."""

from pathlib import Path

import pytest

from lapwing.cosim.scene import SceneError
from lapwing.services.trajectory.schema import parse_table

FILE = Path("points.csv")


def test_csv_points_are_read():
    assert parse_table("time , value\n0,1\n2,5e-1\n", FILE) == [[0.0, 1.0], [2.0, 0.5]]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("t,v\n0,1\n", "points.csv:1: expected the header time,value, got 't,v'"),
        ("", "points.csv:1: expected the header time,value, got ''"),
        ("time,value\n0,1\n", "points.csv:2: expected at least two points"),
        ("time,value\n0,1\n1,x\n", "points.csv:3: expected two numbers, got '1,x'"),
        ("time,value\n0,1\n1,2,3\n", "points.csv:3: expected two numbers"),
        ("time,value\n0,1\n1,nan\n", "points.csv:3: expected finite numbers"),
        ("time,value\n1,1\n2,2\n", "points.csv:2: expected times that start at 0 and ascend"),
        ("time,value\n0,1\n0,2\n", "points.csv:3: expected times that start at 0 and ascend"),
    ],
)
def test_invalid_csv_is_rejected_with_its_line(text, message):
    with pytest.raises(SceneError) as error:
        parse_table(text, FILE)
    assert str(error.value).startswith(message)
