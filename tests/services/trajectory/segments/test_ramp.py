import pytest

from lapwing.services.trajectory.polynomial_piece import Piece
from lapwing.services.trajectory.segments import KINDS

Ramp = KINDS["ramp"]


def test_rate_is_a_magnitude_whatever_the_direction():
    assert Ramp(to=10.0, rate=2.0).pieces(4.0) == [Piece(3.0, (4.0, 2.0))]
    assert Ramp(to=-2.0, rate=2.0).pieces(4.0) == [Piece(3.0, (4.0, -2.0))]
    assert Ramp(to=-2.0, rate=2.0).end(4.0) == -2.0


def test_duration_sets_the_rate_and_a_ramp_to_here_takes_no_time():
    assert Ramp(to=10.0, duration=3.0).pieces(4.0) == [Piece(3.0, (4.0, 2.0))]
    assert Ramp(to=4.0, rate=1.0).pieces(4.0) == []
    assert Ramp(to=4.0, duration=3.0).pieces(4.0) == [Piece(3.0, (4.0, 0.0))]


def test_rate_and_duration_exclude_each_other():
    with pytest.raises(ValueError, match="either rate or duration"):
        Ramp(to=1.0, rate=1.0, duration=1.0)
