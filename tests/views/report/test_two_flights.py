"""Report of two flights."""

import numpy as np
from circle_report import Page, messages, record

from lapwing.flights.flight_data import FlightData
from lapwing.views.report import flight_phases, write
from lapwing.views.report.flight_header import MANY, differences
from lapwing.views.report.plot import Line, Panel, Plot
from lapwing.views.report.plots import position
from lapwing.views.report.sections import overlay


def test_two_flights_are_overlaid(log, tmp_path):
    other = record(tmp_path / "weak.mcap", messages(rotors=0))
    page = Page(write([FlightData.read(log), FlightData.read(other)], tmp_path / "both.html"))
    names = [trace["name"] for trace in page.plots["position"]["data"]]
    assert names == ["flown", "reference", "", "± RMSE", "± RMSE"] * 3  # equal flights
    assert any("Of circle alone (weak: the vehicle has no motors)." in text for text in page.texts)
    assert any(text.startswith("weak: Landed") for text in page.texts)


def test_differences_of_two_flights_have_names(log, tmp_path):
    other = record(tmp_path / "moved.mcap", messages(east=1.0))  # same reference
    one, two = (position.draw(FlightData.read(path)) for path in (log, other))
    both = overlay(one, two, ("a", "b"))
    assert [mark.name for mark in both.panels[0].marks] == ["flown, a", "reference", "flown, b"]
    assert both.panels[1].title == "RMSE 0.1000 m / 0.9000 m"
    assert "Above the panels: a / b." in both.caption
    same = next(
        panel for panel in both.panels if panel.y_label == "y [m]"
    ).marks  # the legend has the name of each flight
    assert [mark.name for mark in same] == ["flown, a", "reference", "flown, b"]
    names = {mark.name for panel in both.panels for mark in panel.marks}
    assert names == {"flown, a", "flown, b", "reference", "± RMSE, a", "± RMSE, b", ""}


def test_caption_of_two_flights_has_shared_sentences_once():
    panel = Panel((Line(np.arange(3.0), np.arange(3.0)),))
    one, two = (
        Plot((panel,), f"Power of each motor. All take {value} W h. Marked: a limit.", 3.0) for value in (1, 2.5)
    )
    expected = "Power of each motor. Marked: a limit. a: All take 1 W h. b: All take 2.5 W h."
    assert overlay(one, two, ("a", "b")).caption == expected
    assert overlay(one, one, ("a", "b")).caption == one.caption


def test_keys_in_which_two_scenes_differ():
    one = {"effects": {"gravity": {}, "wind": {"sigma": 1.0}}, "run": {"seed": 1}}
    other = {"effects": {"wind": {"sigma": 2.0}}, "run": {"seed": 1}}
    assert differences(one, other) == {"effects.gravity": ("yes", ""), "effects.wind.sigma": ("1", "2")}
    assert differences({"published": {"rmse": {"x": 1.0}}, "run": {"title": "a"}}, {"run": {"title": "b"}}) == {}
    one = {"box": [{"top": 3.0, "open": True}, {"top": 2.0}], "points": [[0.0, 1.5]]}
    assert differences(one, {}) == {
        "box.0.top": ("3", ""),
        "box.0.open": ("true", ""),
        "box.1.top": ("2", ""),
        "points": ("[[0, 1.5]]", ""),
    }
    assert len(differences({str(k): k for k in range(MANY + 3)}, {})) == MANY + 3


def test_map_shows_both_flights_and_errors_only_armed_time():
    maps = [
        Plot((Panel((Line(np.zeros(2), np.zeros(2)),), x_range=(-side, 1.0), y_range=(-1.0, side)),), "", 1.0)
        for side in (1.0, 134.0)
    ]
    (panel,) = overlay(*maps, ("near", "far")).panels
    assert (panel.x_range, panel.y_range) == ((-134.0, 1.0), (-1.0, 134.0))
    armed = np.array([False, True, True, False, False, True])
    assert [(list(rows), list(part)) for rows, part in flight_phases._stretches(armed)] == [
        ([1, 2], [0, 1]),
        ([5], [2]),
    ]
