"""Segment "through": joins values and rates without acceleration at its ends."""

import numpy as np
import pytest

from lapwing.services.trajectory.segments.through import Through


@pytest.mark.parametrize(("start_rate", "end_rate"), [(0.0, 0.0), (2.0, -1.0), (3.0, 3.0)])
def test_ends_have_given_values_and_rates(start_rate, end_rate):
    segment = Through(to=5.0, duration=4.0, start_rate=start_rate, end_rate=end_rate)
    (piece,) = segment.pieces(-1.0)
    curve = np.polynomial.Polynomial(piece.polynomial)
    for time, value, rate in ((0.0, -1.0, start_rate), (4.0, 5.0, end_rate)):
        assert curve(time) == pytest.approx(value)
        assert curve.deriv()(time) == pytest.approx(rate)
        assert curve.deriv(2)(time) == pytest.approx(0.0, abs=1e-12)
    assert segment.end(-1.0) == 5.0


def test_segment_at_its_mean_rate_is_straight():
    (piece,) = Through(to=12.0, duration=4.0, start_rate=3.0, end_rate=3.0).pieces(0.0)
    assert piece.polynomial == pytest.approx((0.0, 3.0, 0.0, 0.0, 0.0, 0.0))
