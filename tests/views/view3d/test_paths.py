"""3D view: thinned paths, dashes and trails."""

import copy

import numpy as np
import pytest
from flights_in_space import Recorder, flight

from lapwing.flights.flight_data import FlightData
from lapwing.flights.topic_view import TopicView
from lapwing.views.view3d.live_trail import LINES, POINTS, LiveTrail
from lapwing.views.view3d.sampling import dashes, thin_path
from lapwing.views.view3d.stage import Vehicle, error_colours

pytest.importorskip("viser", reason="needs viser (pip install lapwing[view3d])")


def test_straight_path_is_thinned_to_its_corners():
    corners = np.array([(0.0, 0.0), (8.0, 0.0), (8.0, 2.0)])
    path = np.column_stack([np.interp(np.arange(21), (0, 10, 20), corners[:, i]) for i in (0, 1)])
    assert thin_path(path, 1e-6).tolist() == [0, 10, 20]


def test_path_at_unequal_speed_keeps_its_times():
    path = np.column_stack([np.interp(np.arange(21), (0, 10, 20), (0.0, 1.0, 9.0)), np.zeros(21)])  # a straight line
    assert thin_path(path, 1e-6).tolist() == [0, 10, 20]


def test_thinned_parabola_has_pieces_of_known_length():
    t = np.arange(1025) / 1024.0
    path, tolerance = np.column_stack([t, t**2]), 1.01 / 4.0 / 16.0**2
    keep = thin_path(path, tolerance)  # a chord of duration h is h^2 / 4 away from t^2
    assert np.diff(t[keep]) == pytest.approx(np.full(16, 1.0 / 16.0))
    drawn = np.column_stack([np.interp(t, t[keep], path[keep, i]) for i in (0, 1)])
    assert np.abs(drawn - path).max() <= tolerance


def test_thinned_path_keeps_points_beside_gap():
    path = np.arange(9.0)[:, None] * np.array([1.0, 2.0])
    path[4] = np.nan
    keep = thin_path(path, 1e-6).tolist()
    assert {3, 4, 5} <= set(keep)


def test_path_without_first_and_last_point_is_thinned():
    path = np.arange(9.0)[:, None] * np.array([1.0, 2.0])
    path[[0, -1]] = np.nan
    assert thin_path(path, 1e-6).tolist() == [0, 1, 7, 8]


def test_dashes_have_their_length_and_skip_rest_and_missing_points():
    rest = np.zeros((50, 3))
    path = np.concatenate(
        [[(np.nan,) * 3], rest, [(1.0, 0.0, 0.0), (2.0, 0.0, 0.0)], np.tile((2.0, 0.0, 0.0), (50, 1))]
    )
    result = dashes(path, 0.1, 750)
    assert result[:, 0, 0] == pytest.approx(np.arange(10) / 5.0)
    assert result[:, 1] - result[:, 0] == pytest.approx(np.tile((0.1, 0.0, 0.0), (10, 1)))
    assert len(dashes(path, 0.1, 4)) == 4
    assert len(dashes(rest, 0.1, 4)) == 0


def test_live_trail_is_flown_path_in_few_lines():
    values, scene = flight(ticks=20), Recorder()
    trail = LiveTrail(Vehicle(scene, 0, values, "drone1", "#0072B2"), 0.25)
    steps = 3 * POINTS // 4
    for k in range(steps):
        truth = {name: values.truth[name] for name in values.truth.fields}
        truth["pose.position"] = values.truth.position + np.array([0.0, 0.0, 0.2 * k])
        views = {"ground_truth": TopicView(np.arange(20) * 10**7 + k * 200_000_000, truth)}
        trail.extend(FlightData(views, copy.copy(values.origin)))
    lines = [node for name, node in scene.nodes.items() if "/trail/" in name]
    drawn = [getattr(line, "points", line.arguments[0]) for line in lines]
    assert len(lines) == 4
    assert len(lines) < LINES
    ends = [(points[0, 0, 2], points[-1, 1, 2]) for points in drawn]
    assert [stop for _, stop in ends[:-1]] == pytest.approx([start for start, _ in ends[1:]])
    assert (ends[0][0], ends[-1][1]) == pytest.approx((0.0, 0.2 * (steps - 1) + 0.19), abs=1e-3)


def test_error_colours_run_from_dark_blue_to_orange():
    low, high = error_colours(np.array([0.0, 2.0]))
    assert (low.tolist(), high.tolist()) == ([0, 76, 140], [224, 110, 20])
