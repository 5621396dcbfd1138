import numpy as np
import pytest

from lapwing.services.trajectory.polynomial_piece import Channel, channel_at
from lapwing.services.trajectory.segments import KINDS


def test_segment_starts_and_ends_at_rest():
    segment = KINDS["smoothstep"](to=-1.0, duration=2.0)
    (piece,) = segment.pieces(3.0)
    channel = Channel(np.array([0.0]), np.array([piece.row()]))
    start, middle, end = (channel_at(channel, t) for t in (0.0, 1.0, 2.0))
    assert start[:2] == (
        3.0,
        0.0,
    )
    assert middle[:2] == pytest.approx((1.0, 1.5 * -4.0 / 2.0))
    assert end[:2] == pytest.approx(
        (
            -1.0,
            0.0,
        ),
        abs=1e-12,
    )
    assert segment.end(3.0) == -1.0
