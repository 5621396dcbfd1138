import numpy as np
import pytest

from lapwing.services.trajectory.polynomial_piece import Channel, channel_at
from lapwing.services.trajectory.segments import KINDS


@pytest.mark.parametrize(("kind", "fastest", "at_rest"), [("minimum_jerk", 1.875, 3), ("smoothstep", 1.5, 2)])
def test_segment_starts_and_ends_at_rest(kind, fastest, at_rest):
    segment = KINDS[kind](to=-1.0, duration=2.0)
    (piece,) = segment.pieces(3.0)
    channel = Channel(np.array([0.0]), np.array([piece.row()]))
    start, middle, end = (channel_at(channel, t) for t in (0.0, 1.0, 2.0))
    assert start[:at_rest] == (3.0, 0.0, 0.0)[:at_rest]
    assert middle[:2] == pytest.approx((1.0, fastest * -4.0 / 2.0))
    assert end[:at_rest] == pytest.approx((-1.0, 0.0, 0.0)[:at_rest], abs=1e-12)
    assert segment.end(3.0) == -1.0
