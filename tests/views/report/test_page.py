"""Page of the report: plots, texts and self-containment."""

import math
import shutil
import subprocess
import sys
from itertools import pairwise

import numpy as np
import pytest
from circle_report import OFFSET, RATE, SECONDS, report, values

from lapwing.flights.flight_data import FlightData
from lapwing.views.report import flight_header, plots
from lapwing.views.report.plot import Line, Panel, Plot
from lapwing.views.report.plotly_figure import figure
from lapwing.views.report.plots import motors


def test_every_plot_is_on_page_in_its_order(page):
    of_multirotors = [m for m in plots.modules() if "rigid_body" in getattr(m, "MODELS", ("rigid_body",))]
    names = [m.__name__.rpartition(".")[2] for m in of_multirotors if not getattr(m, "FLEET", False)]
    assert names[:3] == ["mission_map", "timeline", "position"]
    assert page.ids == [names[0], "space", *names[1:]]
    assert list(page.plots) == [name for name in names if name != "battery"]


def test_plot_contains_flight_data(log, page):
    x = page.plots["position"]["data"][0]
    flight = FlightData.read(log)
    assert x["name"] == "flown"
    assert values(x["x"]) == pytest.approx(flight.truth.times, abs=SECONDS / 65534)
    assert values(x["y"]) == pytest.approx(flight.truth.position[:, 0], abs=2.0 / 65534)


def test_axes_over_time_are_linked_and_have_units(page):
    for name in ("timeline", "position", "attitude", "motors", "estimator", "air"):
        plot = page.plots[name]
        first, *others = plot["timed"]
        assert all(plot["layout"][axis]["matches"] == first.replace("axis", "") for axis in others)
        assert "time [s]" in [plot["layout"][axis]["title"]["text"] for axis in plot["timed"]]
    assert page.plots["propulsion"]["timed"] == []


def test_angles_are_in_degrees(page):
    titles = [
        axis["title"]["text"] for key, axis in page.plots["attitude"]["layout"].items() if key.startswith("yaxis")
    ]
    assert titles == ["roll [°]", "roll error [°]", "pitch [°]", "pitch error [°]", "yaw [°]", "yaw error [°]"]
    error = page.plots["attitude"]["data"][2]
    assert values(error["y"]) == pytest.approx(math.degrees(OFFSET[3]), rel=1e-5)


def test_path_is_seen_from_above_and_from_two_sides(page):
    above = page.plots["mission_map"]["data"][0]
    south, _, east, _ = page.plots["path"]["data"]
    assert [trace["type"] for trace in (above, south, east)] == ["scatter"] * 3
    assert values(above["x"]) == pytest.approx(values(south["x"]))
    assert values(above["y"]) == pytest.approx(values(east["x"]))
    assert values(south["y"])[-1] == pytest.approx(1.0 + 0.1 * SECONDS)


CELLS = ((0, 0, "place", ""), (0, 1, "", ""), (1, 0, "rate", "speed"), (1, 1, "", "height"))


def test_panels_of_a_grid_have_their_labels_in_one_column():
    x = np.arange(3.0)
    grid = [Panel((Line(x, x),), y, low, row=r, column=c, timed=False) for r, c, y, low in CELLS]
    narrow = figure(Plot(tuple(grid), "", 4.0, (1.0, 1.0), (1.0, 1.0)))["narrow"]
    assert narrow["titles"] == {"xaxis": "speed", "yaxis2": "place", "xaxis2": "height", "yaxis4": "rate"}


def test_narrow_page_has_one_column_without_overlap(page):
    for plot in page.plots.values():
        places = sorted(plot["narrow"]["domains"].values(), reverse=True)
        assert len(places) == sum(key.startswith("yaxis") for key in plot["layout"])
        assert all(0.0 <= low < high <= 1.0 for low, high in places)
        assert all(upper[0] > lower[1] for upper, lower in pairwise(places))


def test_timeline_lists_service_event_and_time(page):
    bars = [(b["y"][0], b["text"][0], b["base"][0], b["x"][0]) for b in page.plots["timeline"]["data"]]
    assert ("phase", "climb", 0.0, 3.0) in bars
    assert [bar[:2] for bar in bars if bar[0] == "landed"] == [("landed", "landed")]
    assert any("None in this flight: mode, armed, failsafe" in text for text in page.texts)


def test_motors_at_limit_are_marked(log):
    flight = FlightData.read(log)
    flight.origin.scene["airframe"] = {"motor": {"max_voltage": 34.0}}
    marks, output = motors.limits(flight)
    assert "voltage limit (0 or 34 V) in the air, in total for " in output
    stretch = marks[-1]
    assert stretch.name == "at a limit"
    assert np.isnan(stretch.x[2::3]).all()
    # 0.1 (300 + 50 sin t) > 34 from arcsin 0.8 (not yet armed) to pi - arcsin 0.8
    assert stretch.x[:2] == pytest.approx((1.0, math.pi - math.asin(0.8)), abs=1.0 / RATE)


def test_page_has_no_external_resources(page):
    assert page.addresses == []
    assert not {"link", "iframe", "img"} & set(page.tags)
    assert not any("url(" in text or "@import" in text for text in page.texts)


@pytest.mark.long
def test_neither_matplotlib_nor_plotly_is_imported_for_page(log):
    code = (
        "import sys; from pathlib import Path; from lapwing.flights.flight_data import FlightData;"
        "from lapwing.views.report import write;"
        f"write(FlightData.read({str(log)!r}), Path({str(log.with_suffix('.html'))!r}));"
        "print([name for name in ('matplotlib', 'plotly') if name in sys.modules])"
    )
    assert subprocess.run([sys.executable, "-c", code], check=True, capture_output=True).stdout.strip() == b"[]"


def own_controller(flight, name, gains):
    flight.origin.scene["autopilot"] = {"controller": name, "gains": gains}
    flight.origin.scene["gains"] = {"altitude": {"p": float(len(gains))}}
    return flight


def test_own_controller_lists_no_gains(log):
    flights = [own_controller(FlightData.read(log), *given) for given in ((None, "tuned"), ("mine:Lee", "paper"))]
    assert flight_header.facts(flights[0])["gains"] == "tuned"
    assert flight_header.facts(flights[0])["controller"] == "cascaded PID"
    assert flight_header.facts(flights[1])["controller"] == "mine:Lee"
    assert "gains" not in flight_header.facts(flights[1])
    results = flight_header.differences(*(flight.origin.scene for flight in flights))
    assert list(results) == ["autopilot.controller"]


CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


@pytest.mark.long
@pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium")
def test_browser_draws_page_without_error(log, tmp_path):
    page = report(log)
    text = page.read_text(encoding="utf-8")
    listen = 'window.addEventListener("error", (e) => document.body.setAttribute("complaint", e.message));'
    page = tmp_path / "page.html"
    text = text.replace("<details>", "<details open>")
    page.write_text(text.replace("<body>", f"<body><script>{listen}</script>", 1), encoding="utf-8")
    quiet = ("--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={tmp_path / 'profile'}")
    words = (CHROMIUM, *quiet, "--window-size=1200,9000", "--virtual-time-budget=30000", "--dump-dom", page.as_uri())
    drawn = subprocess.run(words, check=True, capture_output=True, text=True, timeout=300).stdout
    assert "complaint=" not in drawn
    assert drawn.count('data-drawn="yes"') == text.count('<figure class="plot">')
    assert drawn.count("main-svg") >= 2 * text.count('<figure class="plot">')
