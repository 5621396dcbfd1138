import pytest

from services.trajectory.piece import Piece
from services.trajectory.segments import KINDS


def write(folder, text):
    (folder / "points.csv").write_text(text, encoding="utf-8")
    return KINDS["table"](file="points.csv")


def test_points_are_joined_by_straight_lines(tmp_path):
    table = write(tmp_path, "time,value\n0,1\n2,5\n3,4\n")
    assert table.pieces(1.0, tmp_path) == [Piece(2.0, (1.0, 2.0)), Piece(1.0, (5.0, -1.0))]
    assert table.end(1.0, tmp_path) == 4.0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("t,v\n0,1\n", "first line must be"),
        ("", "first line must be"),
        ("time,value\n0,1\n", "at least two points"),
        ("time,value\n0,1\n1,x\n", "line 3: expected two numbers"),
        ("time,value\n0,1\n1,2,3\n", "line 3: expected two numbers"),
        ("time,value\n0,1\n1,nan\n", "line 3: expected finite numbers"),
        ("time,value\n1,1\n2,2\n", "line 2: times must start at 0"),
        ("time,value\n0,1\n0,2\n", "line 3: times must start at 0 and ascend"),
        ("time,value\n0,2\n1,3\n", "starts at 2.0, but the channel is at 1.0"),
    ],
)
def test_a_wrong_file_is_refused_with_its_line(tmp_path, text, message):
    with pytest.raises(ValueError, match=r"points\.csv") as error:
        write(tmp_path, text).pieces(1.0, tmp_path)
    assert message in str(error.value)
