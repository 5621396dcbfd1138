import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lapwing.services.trajectory.polynomial_piece import (
    Channel,
    Parameters,
    Piece,
    channel_at,
    evaluate,
    last_not_after,
)

NUMBER = st.floats(-3.0, 3.0)


def channel(*pieces):
    starts = np.cumsum([0.0, *(piece.duration for piece in pieces[:-1])])
    return Channel(starts, np.array([piece.row() for piece in pieces]))


@given(st.tuples(*[NUMBER] * 6), NUMBER, NUMBER, NUMBER, st.floats(0.1, 1.9))
@settings(deadline=None)
def test_channel_derivatives_match_finite_differences(polynomial, amplitude, frequency, sweep, t):
    c = channel(Piece(2.0, polynomial, amplitude, frequency, sweep))
    h = 1e-4
    (before, rate_before, _), (_, rate, acceleration), (after, rate_after, _) = (
        channel_at(c, t + d) for d in (-h, 0.0, h)
    )
    assert rate == pytest.approx((after - before) / (2.0 * h), rel=1e-5, abs=1e-3)
    assert acceleration == pytest.approx((rate_after - rate_before) / (2.0 * h), rel=1e-5, abs=1e-2)


@given(st.lists(st.floats(0.01, 5.0), min_size=1, max_size=20), st.floats(-1.0, 60.0))
@settings(deadline=None)
def test_search_matches_numpy(durations, t):
    times = np.cumsum([0.0, *durations])
    assert last_not_after(times, t) == max(np.searchsorted(times, t, side="right") - 1, 0)


def test_joint_belongs_to_later_piece():
    c = channel(Piece(1.0, (0.0, 1.0)), Piece(1.0, (5.0, -2.0)), Piece(0.0, (3.0,)))
    assert channel_at(c, 1.0) == (5.0, -2.0, 0.0)
    assert channel_at(c, np.nextafter(1.0, 0.0))[1] == 1.0
    assert channel_at(c, 2.0) == (3.0, 0.0, 0.0)
    assert channel_at(c, 99.0) == (3.0, 0.0, 0.0)


def test_reference_is_offset_by_origin():
    ramp, still = channel(Piece(9.0, (0.0, 1.0))), channel(Piece(0.0, (0.0,)))
    p = Parameters(ramp, still, still, ramp, np.array([0.0, 2.0]), np.zeros(2), np.zeros(2), (1.0, 2.0, 3.0), 0.5)
    r = evaluate(p, 4.0, 0)
    assert r.position_world == (5.0, 2.0, 3.0)
    assert r.velocity_world == (1.0, 0.0, 0.0)
    assert (r.yaw, r.yaw_rate, r.phase) == (4.5, 1.0, 1)
    assert evaluate(p, -1.0, 0) == evaluate(p, 0.0, 0)
