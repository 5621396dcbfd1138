import pytest

from lapwing.services.trajectory.polynomial_piece import Piece
from lapwing.services.trajectory.segments import KINDS

Ramp = KINDS["ramp"]


def test_ramp_rate_is_magnitude():
    assert Ramp(to=10.0, rate=2.0).pieces(4.0) == [Piece(3.0, (4.0, 2.0))]
    assert Ramp(to=-2.0, rate=2.0).pieces(4.0) == [Piece(3.0, (4.0, -2.0))]
    assert Ramp(to=-2.0, rate=2.0).end(4.0) == -2.0


def test_ramp_duration_sets_rate():
    assert Ramp(to=10.0, duration=3.0).pieces(4.0) == [Piece(3.0, (4.0, 2.0))]
    assert Ramp(to=4.0, rate=1.0).pieces(4.0) == []
    assert Ramp(to=4.0, duration=3.0).pieces(4.0) == [Piece(3.0, (4.0, 0.0))]


def test_ramp_rejects_rate_and_duration_together():
    with pytest.raises(ValueError, match="exactly one of rate and duration"):
        Ramp(to=1.0, rate=1.0, duration=1.0)
