"""Mission map: wind, events, and areas of a plan."""

from types import SimpleNamespace

import numpy as np
import pytest
import synthetic_flights

from lapwing.flights.flight_events import Event
from lapwing.flights.plan_shapes import fence_shapes, waypoints
from lapwing.flights.topic_view import TopicView
from lapwing.views.report.plots import mission_map

TICKS, RATE = 101, 10


def flight(terrain=None):
    """Return a flight of 10 m east in 10 s, in wind from the west."""
    t = np.arange(TICKS) / RATE
    truth = {
        "pose.position": np.column_stack([t, 0.0 * t, 0.0 * t + 2.0]),
        "pose.orientation": synthetic_flights.LEVEL,
        "wind": (3.0, 0.0, 0.5),
    }
    scene = {"environment": {"terrain": terrain}} if terrain else {}
    result = synthetic_flights.flight(TICKS, RATE, scene=scene, ground_truth=truth)
    result.events = [Event(1.0, "phase", "east"), Event(4.0, "fault", "rotor 1"), Event(5.0, "fault", "rotor 2")]
    return result


def named(name, values=None):
    return [mark for mark in mission_map.draw(values or flight()).panels[0].marks if mark.name.startswith(name)]


def test_all_vehicles_of_fleet_are_on_map_by_name():
    first, second = flight(), flight()
    moved = {name: second.truth[name] for name in second.truth.fields}
    moved["pose.position"] = second.truth.position + np.array([0.0, 30.0, 0.0])
    first.fleet = {"wing": TopicView(second.truth._times_ns, moved), first.vehicle: first.truth}
    panel = mission_map.draw(first).panels[0]
    lines = {mark.name: mark for mark in panel.marks}
    assert lines["wing"].y == pytest.approx(np.full(TICKS, 30.0))
    assert lines[first.vehicle].y == pytest.approx(np.zeros(TICKS))
    assert lines["wing"].colour != lines[first.vehicle].colour
    assert panel.y_range[0] < 0.0
    assert panel.y_range[1] > 30.0


def test_faults_are_drawn_at_position_of_vehicle():
    (faults,) = named("fault")
    assert faults.x == pytest.approx([4.0, 5.0])
    assert not named("phase")


def test_wind_arrow_points_downwind_with_mean_speed():
    (arrow,) = named("mean wind 3.0 m/s")
    assert arrow.x[1] > arrow.x[0]
    assert arrow.y[1] == pytest.approx(arrow.y[0])


def test_obstacle_is_turned_by_its_heading():
    box = {"position": [5.0, 1.0], "size": [4.0, 2.0], "top": 3.0, "heading": np.pi / 2}
    (outline,) = named("obstacle", flight({"box": [box]}))
    assert (np.ptp(outline.x), np.ptp(outline.y)) == (pytest.approx(2.0), pytest.approx(4.0))


@pytest.mark.parametrize(("radius", "widened"), [(12.0, True), (500.0, False)])
def test_fence_widens_map_unless_it_is_far_larger(monkeypatch, radius, widened):
    square = SimpleNamespace(stay_in=True, corners=radius * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)], float))
    monkeypatch.setattr(mission_map, "fence_shapes", lambda _: [square])
    plot = mission_map.draw(flight())
    assert (plot.panels[0].x_range[0] < -radius) == widened
    assert ("beyond this map" in plot.caption) != widened


def test_flight_without_plan_has_no_waypoints_and_no_fence():
    assert waypoints(flight()).shape == (0, 3)
    assert list(fence_shapes(flight())) == []
