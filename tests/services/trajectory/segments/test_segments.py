"""Kinds of segments."""

import math

import numpy as np
import pytest

from lapwing.services.trajectory.polynomial_piece import Channel, Piece, channel_at
from lapwing.services.trajectory.segments import KINDS
from lapwing.services.trajectory.segments.through import Through


def test_chirp_frequency_sweeps_linearly():
    chirp = KINDS["chirp"](amplitude=0.5, start_frequency=0.2, end_frequency=3.0, duration=10.0)
    (piece,) = chirp.pieces(1.0)
    t = np.linspace(0.0, 10.0, 2001)
    phase = 2.0 * math.pi * np.cumsum(np.concatenate(([0.0], (0.2 + 0.28 * (t[1:] + t[:-1]) / 2.0) * np.diff(t))))
    channel = Channel(np.array([0.0]), np.array([piece.row()]))
    assert [channel_at(channel, x)[0] for x in t] == pytest.approx(1.0 + 0.5 * np.sin(phase), abs=1e-9)
    assert chirp.end(1.0) == pytest.approx(channel_at(channel, 10.0)[0], abs=1e-12)


def test_hold_is_constant():
    hold = KINDS["hold"](duration=2.0)
    assert hold.pieces(3.0) == [Piece(2.0, (3.0,))]
    assert hold.end(3.0) == 3.0


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


Sine = KINDS["sine"]


def test_sine_oscillates_about_its_start():
    assert Sine(amplitude=2.0, frequency=0.5, duration=4.0).pieces(1.0) == [Piece(4.0, (1.0,), 2.0, math.pi)]


def test_whole_sine_cycles_end_exactly_at_start():
    assert Sine(amplitude=2.0, frequency=0.5, duration=4.0).end(1.0) == 1.0
    assert Sine(amplitude=2.0, frequency=0.5, duration=4.5).end(1.0) == 1.0 + 2.0 * math.sin(math.pi / 4.0 * 2.0)


def test_step_has_no_duration():
    step = KINDS["step"](to=2.0)
    assert step.pieces(0.0) == []
    assert step.end(0.0) == 2.0


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
