import pytest

from lapwing.services.trajectory.polynomial_piece import Piece
from lapwing.services.trajectory.segments import KINDS


def test_table_is_interpolated_linearly():
    table = KINDS["table"](points=((0.0, 1.0), (2.0, 5.0), (3.0, 4.0)))
    assert table.pieces(1.0) == [Piece(2.0, (1.0, 2.0)), Piece(1.0, (5.0, -1.0))]
    assert table.end(1.0) == 4.0


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (((0.0, 1.0),), "at least 2"),
        (((1.0, 1.0), (2.0, 2.0)), "times that start at 0"),
        (((0.0, 1.0), (0.0, 2.0)), "times that ascend"),
        (((0.0, 2.0), (1.0, 3.0)), "starts at 2.0, but the channel is at 1.0"),
    ],
)
def test_invalid_table_points_are_rejected(points, message):
    with pytest.raises(ValueError, match=message):
        KINDS["table"](points=points).pieces(1.0)
