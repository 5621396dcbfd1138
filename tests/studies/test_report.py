"""Report of a synthetic flight with analytically known figures."""

import base64
import gzip
import importlib
import json
import math
import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser
from itertools import pairwise

import numpy as np
import pytest
import synthetic_flights
from scipy.spatial.transform import Rotation

from lapwing.cosim.config.provenance import attachments as attachments_of
from lapwing.cosim.log import LogWriter
from lapwing.messages import (
    Actuators,
    Estimate,
    Imu,
    Point,
    Pose,
    Quaternion,
    Setpoint,
    Status,
    Vector3,
    VehicleState,
    header,
)
from lapwing.studies.flight_data import FlightData
from lapwing.studies.flight_tracking import AXES
from lapwing.studies.report import flight_header, paper, plotly_script, plotly_traces, plots, write
from lapwing.studies.report.downsampling import thin
from lapwing.studies.report.flight_cover import cover
from lapwing.studies.report.flight_header import MANY, differences
from lapwing.studies.report.flight_phases import phases
from lapwing.studies.report.key_numbers import key_numbers
from lapwing.studies.report.overlay import overlay
from lapwing.studies.report.plot import Line, Panel, Plot
from lapwing.studies.report.plotly_figure import figure
from lapwing.studies.report.plots import air, estimator, motors, position, propulsion
from lapwing.studies.report.style import POINTS
from lapwing.studies.rotation_arrays import conjugate, from_xyzw, product, rotation_vector

RATE, SECONDS = 50, 6.0
OFFSET = (0.1, -0.2, 0.05, 0.01, -0.02, 0.03)  # reference minus truth, so the errors are these numbers
THRUST, TORQUE = 2e-4, 8e-6  # over speed squared
ESTIMATE_ERROR = 0.02  # estimate minus truth of x [m]
SETUP = synthetic_flights.setup(
    int(RATE * SECONDS) + 1,
    RATE,
    run={"title": "a circle <by> formula"},
    published={"source": "paper, Table 7", "rmse": {"x": 0.2373, "yaw": 0.0220}},
)
METADATA = {
    "scene": "circle",
    "seed": "7",
    "mode": "single-process",
    "solver_integrator": "rk4",
    "solver_step": "0.001",
}


def rotation(roll, pitch, yaw):
    """Return the quaternion of yaw, then pitch, then roll about rotated axes, from a textbook formula."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a / 2), math.sin(a / 2)) for a in (roll, pitch, yaw))
    return Quaternion(
        x=sr * cp * cy - cr * sp * sy,
        y=cr * sp * cy + sr * cp * sy,
        z=cr * cp * sy - sr * sp * cy,
        w=cr * cp * cy + sr * sp * sy,
    )


def messages(std=0.05, rotors=4, reference=True, east=0.0):
    """Yield topic and message of each tick: a circle with oscillating angles, motors armed from 1 s on."""
    for tick in range(int(RATE * SECONDS) + 1):
        t = tick / RATE
        stamp = header(tick * 1_000_000_000 // RATE, "world")
        position = (math.cos(t), math.sin(t), 1.0 + 0.1 * t)
        angles = (0.1 * math.sin(t), 0.1 * math.cos(t), 0.2 * t)
        speed = (300.0 + 50.0 * math.sin(t),) * rotors
        pose = Pose(Point(position[0] + east, *position[1:]), rotation(*angles))
        truth = VehicleState(stamp, pose)._replace(
            rotor_speed=speed,
            motor_voltage=tuple(0.1 * w for w in speed),
            motor_current=tuple(0.03 * w for w in speed),
            motor_power=tuple(1e-5 * w**3 for w in speed),
            rotor_thrust=tuple(THRUST * w**2 for w in speed),
            rotor_torque=tuple(TORQUE * w**2 for w in speed),
            wind=Vector3(3.0, math.sin(t), 0.0),
            air_density=1.2,
            ground_contact=t >= SECONDS,
        )
        yield "ground_truth", truth
        requested = [value + offset for value, offset in zip(position + angles, OFFSET, strict=True)]
        if reference:
            phase = "climb" if t < 3.0 else "hover"
            yield "setpoint", Setpoint(stamp)._replace(position=Vector3(*requested[:3]), yaw=requested[5], phase=phase)
            yield (
                "actuators",
                Actuators(stamp)._replace(armed=t >= 1.0, attitude_reference=Vector3(requested[3], requested[4], 0.0)),
            )
        if tick % 5 == 0:
            estimated = pose._replace(position=Point(position[0] + ESTIMATE_ERROR, *position[1:]))
            wrong = ("gps", "sonar") if tick == 50 else ("gps",) if tick == 100 else ()
            spread = dict.fromkeys(("position_std", "velocity_std", "attitude_std"), Vector3(std, std, std))
            yield "estimate", Estimate(stamp, estimated)._replace(rejected_sources=wrong, **spread)
            yield "status", Status(stamp)._replace(landed=t >= SECONDS, finished=t >= SECONDS)


def record(path, entries, attachments=None):
    with LogWriter(path, METADATA, attachments_of(SETUP, {}) if attachments is None else attachments) as log:
        for topic, message in entries:
            instant = message.header.stamp
            time_ns = instant.sec * 1_000_000_000 + instant.nanosec
            log.write(f"/drone1/{topic}", type(message), message.encode(), time_ns)
            log.flush() if topic == "status" and time_ns % 1_000_000_000 == 0 else None
    return path


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    return record(tmp_path_factory.mktemp("log") / "circle.mcap", messages())


class Page(HTMLParser):
    """Parser of texts, plots and addresses of a page; unclosed elements are an error."""

    def __init__(self, path):
        super().__init__()
        self.plots, self.addresses, self.texts, self.tags, self.ids = {}, [], [], [], []
        self._open = []
        self.feed(path.read_text(encoding="utf-8"))
        self.close()
        assert self._open == []

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        result = dict(attrs)
        if tag == "section":
            self.ids.append(result["id"])
        self.addresses += [v for k, v in attrs if k in ("src", "href", "srcset", "data", "action")]
        if tag not in ("meta", "link", "input"):
            self._open.append("plot" if result.get("type") == "application/gzip" else tag)

    def handle_endtag(self, tag):
        assert self._open.pop() in (tag, "plot")

    def handle_data(self, data):
        if self._open[-1:] == ["plot"]:
            self.plots[self.ids[-1]] = json.loads(gzip.decompress(base64.b64decode(data, validate=True)))
        elif data.strip() and self._open[-1] not in ("script", "style"):
            self.texts.append(data.strip())

    def after(self, text):
        """Return the text after `text`, such as a table's value after its name."""
        return self.texts[self.texts.index(text) + 1]


def report(log):
    """Write the report of a log in its folder and return its path."""
    return write(FlightData.read(log), log.with_suffix(".html"))


@pytest.fixture(scope="module")
def page(log):
    return Page(report(log))


def values(array):
    """Return the numbers of an array as page.js decodes them."""
    if isinstance(array, list):
        return np.array(array, float)
    if "bdata" in array:
        return np.frombuffer(base64.b64decode(array["bdata"], validate=True), "<f4")
    planes = np.frombuffer(base64.b64decode(array["steps"], validate=True), np.uint8).reshape(2, -1)
    changes = planes[0] + 256 * planes[1].astype(int)
    steps = np.cumsum(changes).astype(np.int16).astype(float)
    return np.where(steps == -32768, np.nan, array["low"] + (steps + 32767) * array["step"])


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


def test_narrow_page_has_one_column_without_overlap(page):
    for plot in page.plots.values():
        places = sorted(plot["narrow"]["domains"].values(), reverse=True)
        assert len(places) == sum(key.startswith("yaxis") for key in plot["layout"])
        assert all(0.0 <= low < high <= 1.0 for low, high in places)
        assert all(upper[0] > lower[1] for upper, lower in pairwise(places))


@pytest.mark.parametrize("log_axis", [False, True])
def test_arrays_keep_gaps_and_axis_resolution(log_axis):
    inputs = np.geomspace(1e-6, 1e3, 300)
    inputs[7] = np.nan
    actual = values(plotly_traces._array(inputs, log=log_axis))
    assert np.isnan(actual[7])
    assert actual == pytest.approx(
        inputs, nan_ok=True, **({"rel": 1e-6} if log_axis else {"rel": 0, "abs": 1e3 / 65534})
    )


def test_array_beyond_its_axis_keeps_resolution_of_axis():
    inputs = np.append(np.linspace(0.0, 1.0, 50), 1e6)
    assert values(plotly_traces._array(inputs, shown=(0.0, 1.0))) == pytest.approx(inputs, rel=1e-6, abs=1e-7)


def test_reduced_script_keeps_registered_kinds_of_traces():
    reduced = plotly_script.remove_unused_traces(plotly_script.script())
    kinds = set(re.findall(r'moduleType:"trace",name:"(\w+)"', reduced))
    assert {"scatter", "bar"} <= kinds
    assert not kinds & {"scatter3d", "scattermap", "pie", "heatmap"}
    assert len(plotly_script.gzip_base64(reduced)) < 700_000


def test_script_of_another_build_is_not_reduced():
    assert plotly_script.remove_unused_traces("Plotly = {}") == "Plotly = {}"


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
        "import sys; from pathlib import Path; from lapwing.studies.flight_data import FlightData;"
        "from lapwing.studies.report import write;"
        f"write(FlightData.read({str(log)!r}), Path({str(log.with_suffix('.html'))!r}));"
        "print([name for name in ('matplotlib', 'plotly') if name in sys.modules])"
    )
    assert subprocess.run([sys.executable, "-c", code], check=True, capture_output=True).stdout.strip() == b"[]"


@pytest.mark.long
def test_same_plots_on_paper(log, page, tmp_path):
    pdf = write(FlightData.read(log), tmp_path / "circle.pdf").read_bytes()
    assert b"/Title (" in pdf
    assert pdf.startswith(b"%PDF")
    sizes = re.findall(rb"/MediaBox \[ 0 0 ([\d.]+) ([\d.]+) \]", pdf)
    assert 1 < len(sizes) <= 1 + len(page.plots)
    assert {tuple(round(float(side) / 72.0 * 25.4) for side in size) for size in sizes} == {(210, 297)}  # [mm] A4


def test_paper_has_outcome_errors_facts_and_every_plot(log, page, monkeypatch, tmp_path):
    written = []
    write_pdf = paper.write_pdf
    monkeypatch.setattr(paper, "write_pdf", lambda path, *content: [written.append(content), write_pdf(path, *content)])
    flight = FlightData.read(log)
    write(flight, tmp_path / "circle.pdf")
    ((first, plots),) = written
    assert first.outcomes == (str(flight.outcome),)
    assert [row[0] for row in first.rows] == ["x [m]", "y [m]", "z [m]", "roll [°]", "pitch [°]", "yaw [°]"]
    assert dict(first.facts)["digest"]
    assert first.numbers == tuple((number.label, number) for number in key_numbers(flight))
    assert first.numbers
    assert len(plots) == len(page.plots)


def test_paper_of_two_flights_lists_keys_that_differ(log):
    flights = [FlightData.read(log), FlightData.read(log)]
    flights[1].origin.scene["autopilot"] = {"controller": "geometric:build"}
    facts = cover(flights).facts
    numbers = cover(flights).numbers
    assert [label for label, _ in numbers[:2]] == ["A: position error, RMS", "B: position error, RMS"]
    assert ("scenes differ in", "autopilot.controller: none | geometric:build") in facts
    assert not any(name == "scenes differ in" for name, _ in cover(flights[:1]).facts)


def test_printed_pages_keep_order_of_plots_and_height():
    plots = [paper.Titled(str(k), Plot((), "", height)) for k, height in enumerate((5.0, 5.0, 5.0, 30.0, 1.0))]
    pages = paper._paginate(plots)
    assert [titled for page in pages for titled in page] == plots
    assert all(len(page) == 1 or sum(map(paper._height, page)) <= paper.INNER[1] for page in pages)


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


def test_turbulence_is_drawn_as_mean_and_range():
    times, rng = np.arange(0.0, 10.0, 0.004), np.random.default_rng(1)
    wind = np.array([3.0, 0.0, 0.0]) + rng.normal(size=(len(times), 3))
    *bands, x, _, _ = air._wind(times, wind)
    assert len(x.x) == 10
    assert x.y == pytest.approx(wind[:, 0].reshape(10, 250).mean(axis=1))
    assert bands[0].high == pytest.approx(wind[:, 0].reshape(10, 250).max(axis=1))


def test_script_is_found_in_package_without_other_files(tmp_path, monkeypatch):
    script = tmp_path / "plotly" / "package_data" / "plotly.min.js"
    monkeypatch.setattr(sys, "path", [str(tmp_path)])
    with pytest.raises(ValueError, match="pip install plotly"):
        plotly_script.script()
    script.parent.mkdir(parents=True)
    script.write_text("Plotly = {}")
    importlib.invalidate_caches()
    assert plotly_script.script() == "Plotly = {}"


def test_other_file_endings_are_rejected(log, tmp_path):
    with pytest.raises(ValueError, match=r"circle\.txt: expected a name that ends in \.html, \.pdf or \.png"):
        write(FlightData.read(log), tmp_path / "circle.txt")


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


def test_legend_of_long_names_has_room_above_panels():
    def top(*names):
        marks = tuple(Line(np.arange(3.0), np.arange(3.0), name) for name in names)
        return figure(Plot((Panel(marks),), "", 3.0))["layout"]["margin"]["t"]

    name = "the reference of a flight whose name is longer than half of a line"  # one fits into a line
    assert np.diff([top(*(f"{name} {k}" for k in range(count))) for count in range(4)]).tolist() == [22, 28, 28]


def test_cursor_between_samples_shows_value_and_full_name():
    name = "reference, B & a long name"
    drawn = figure(Plot((Panel((Line(np.arange(3.0), np.arange(3.0), name),)),), "", 3.0, span=(0.0, 2.0)))
    (line,) = (trace for trace in drawn["data"] if trace["type"] == "scatter")
    assert line["hovertemplate"] == "%{y}"  # Plotly's default is "(time, value)" unless a sample is at the cursor
    assert drawn["layout"]["hoverlabel"]["namelength"] == -1


def test_names_of_short_phases_are_left_out_on_phone():
    phases = (("climb", 0.0, 50.0), ("item 2 of 7", 50.0, 60.0), ("i", 60.0, 100.0))
    panel = Panel((Line(np.arange(3.0), np.arange(3.0)),))
    drawn = figure(Plot((panel,), "", 3.0, span=(0.0, 100.0), phases=phases))["layout"]["annotations"]
    assert [(one["text"], one["name"]) for one in drawn] == [("climb", ""), ("item 2 of 7", "wide"), ("i", "")]


def test_texts_at_both_ends_of_axis_have_room():
    panel = Panel(
        (Line(np.arange(3.0), np.arange(3.0)),), timed=False, x_ticks=("[0.0, 0.0, 0.0]", "b", "[9.0, 3.0, 0.0]")
    )
    axis = figure(Plot((panel,), "", 3.0))["layout"]["xaxis"]
    assert axis["range"] == [-0.5, 2.5]
    assert axis["ticktext"] == list(panel.x_ticks)


def test_keys_in_which_two_scenes_differ():
    one = {"effects": {"gravity": {}, "wind": {"sigma": 1.0}}, "run": {"seed": 1}}
    other = {"effects": {"wind": {"sigma": 2.0}}, "run": {"seed": 1}}
    assert differences(one, other) == {"effects.gravity": ("yes", ""), "effects.wind.sigma": ("1", "2")}
    assert differences({"published": {"rmse": {"x": 1.0}}, "run": {"title": "a"}}, {"run": {"title": "b"}}) == {}
    many = differences({str(k): k for k in range(MANY + 3)}, {})
    assert len(many) == MANY + 1
    assert "3 more" in many


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


def test_errors_are_offsets_that_were_flown(log, page):
    for index, (axis, offset) in enumerate(zip(AXES, OFFSET, strict=True)):
        unit, scale = ("m", 1.0) if index < 3 else ("°", 180.0 / math.pi)
        assert page.after(f"{axis} [{unit}]") == f"{scale * abs(offset):.4f}"
        assert FlightData.read(log).rmse[axis] == pytest.approx(abs(offset), rel=1e-9)
        assert FlightData.read(log).errors[axis] == pytest.approx(offset, rel=1e-9)  # also its sign
    assert page.after(page.after("x [m]")) == "0.2373"
    assert page.after(page.after("y [m]")) != "0.2700"  # no published value for y in this scene


def test_summary_equals_log(log, page):
    flight = FlightData.read(log)
    assert page.after("digest") == flight.digest
    assert page.after("duration") == "6.00 s"
    assert page.after("landed") == "yes"
    assert page.after("seed") == "7"
    assert page.after("solver") == "rk4, step 0.001 s"
    assert any("a circle <by> formula" in text for text in page.texts)  # escaped, not parsed as an element


def test_only_armed_samples_count(log):
    assert FlightData.read(log).armed.sum() == RATE * (SECONDS - 1.0) + 1
    assert all(len(e) == FlightData.read(log).armed.sum() for e in FlightData.read(log).errors.values())


def test_phases_follow_one_another(log):
    assert phases(FlightData.read(log)) == [("climb", 0.0, 3.0), ("hover", 3.0, pytest.approx(SECONDS))]


def test_coefficients_equal_those_of_propeller(log):
    flight = FlightData.read(log)
    speed = flight.truth.rotor_speed[:, 0]
    assert propulsion.coefficient(speed, flight.truth.rotor_thrust[:, 0], 2) == pytest.approx(THRUST)
    assert propulsion.coefficient(speed, flight.truth.rotor_torque[:, 0], 2) == pytest.approx(TORQUE)


def test_rotation_vectors_equal_those_of_scipy():
    a, b = (Rotation.random(100, random_state=seed).as_quat() for seed in (1, 2))
    b[:50] *= -1.0  # the same attitudes
    expected = (Rotation.from_quat(a).inv() * Rotation.from_quat(b)).as_rotvec()
    start, end = from_xyzw(a), from_xyzw(b)
    assert rotation_vector(product(conjugate(start), end)) == pytest.approx(expected, abs=1e-14)
    assert not rotation_vector(product(conjugate(start), start)).any()


def test_estimate_errors_and_rejections(log):
    error = estimator.errors(FlightData.read(log))
    expected = np.zeros(9)
    expected[0] = ESTIMATE_ERROR
    assert error == pytest.approx(np.broadcast_to(expected, error.shape), abs=1e-9)
    assert estimator.rejections(FlightData.read(log)) == "Measurements rejected: gps 2, sonar 1."


def test_attitude_error_is_in_body_frame(tmp_path):
    """Truth yawed by 90 degrees; an estimate with 0.1 rad more roll about body x has the error (0.1, 0, 0)."""
    c = math.cos(math.pi / 4)
    true, roll = Quaternion(x=0.0, y=0.0, z=c, w=c), (math.sin(0.05), math.cos(0.05))
    estimated = Quaternion(x=c * roll[0], y=c * roll[0], z=c * roll[1], w=c * roll[1])  # true * roll, by hand
    stamp = header(0, "world")
    both = [
        ("ground_truth", VehicleState(stamp, Pose(Point(), true))),
        ("estimate", Estimate(stamp, Pose(Point(), estimated))),
    ]
    later = [(topic, m._replace(header=header(10**9, "world"))) for topic, m in both]
    error = estimator.errors(FlightData.read(record(tmp_path / "yawed.mcap", both + later)))
    assert error[:, 6:] == pytest.approx(np.array([[0.1, 0.0, 0.0]] * 2), abs=1e-12)


def test_truncated_log_has_report(log, tmp_path):
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(log.read_bytes()[: log.stat().st_size // 2])
    page = Page(report(cut))
    assert page.after("landed") == "no"
    assert page.after("digest") == "none: the log is incomplete"
    assert 0.0 < float(page.after("duration").removesuffix(" s")) < SECONDS
    assert page.after("x [m]") == "0.1000"
    assert "position" in page.plots


def test_missing_data_is_reported(tmp_path):
    page = Page(report(record(tmp_path / "bare.mcap", messages(std=0.0, rotors=0, reference=False), {})))
    text = " ".join(page.texts)
    assert set(page.plots) == {"mission_map", "timeline", "position", "turning", "attitude", "path", "air"}
    assert "Not shown: the vehicle has no motors." in text
    assert "Not shown: the estimate has no standard deviations (it is the truth)." in text
    assert "The log has no reference" in text


def test_single_sample_is_enough(tmp_path):
    page = Page(report(record(tmp_path / "short.mcap", list(messages())[:5])))
    assert page.after("duration") == "0.00 s"
    assert "position" in page.plots


@pytest.mark.parametrize(
    ("content", "complaint"),
    [(None, "cannot be read: no such file or directory; expected a log"), (b"no log", "not an MCAP file")],
    ids=["missing", "foreign"],
)
def test_non_log_file_is_rejected(tmp_path, content, complaint):
    path = tmp_path / "x.mcap"
    if content:
        path.write_bytes(content)
    with pytest.raises(ValueError, match=complaint) as fault:
        report(path)
    assert str(path) in str(fault.value)
    assert "\n" not in str(fault.value)
    assert not path.with_suffix(".html").exists()


def test_log_without_flight_is_rejected(tmp_path):
    path = record(tmp_path / "imu.mcap", [("imu", Imu(header(0, "drone1")))])
    with pytest.raises(ValueError, match="no flight in this log"):
        report(path)


def test_damaged_scene_is_named(tmp_path):
    path = record(tmp_path / "scene.mcap", messages(), {"setup.json": b"[run"})
    with pytest.raises(ValueError, match=r"scene\.mcap: its attachment setup\.json cannot be read"):
        report(path)


def test_unwritable_report_error_is_one_line(log, tmp_path):
    copy = tmp_path / "a.mcap"
    copy.write_bytes(log.read_bytes())
    copy.with_suffix(".html").mkdir()
    with pytest.raises(ValueError, match=r"a\.html: cannot be written: "):
        report(copy)


@pytest.mark.parametrize("count", [POINTS, POINTS + 1, 17051])
def test_thinning_line_keeps_its_peaks_and_ends(count):
    t = np.linspace(0.0, 1.0, count)
    y = np.sin(50.0 * t)
    y[count // 3], y[-2] = 9.0, -9.0
    drawn_t, drawn_y = thin(t, y)
    assert len(drawn_t) <= POINTS + 2
    assert (np.diff(drawn_t) > 0.0).all()
    assert (drawn_t[0], drawn_t[-1]) == (0.0, 1.0)
    assert set(zip(drawn_t, drawn_y, strict=True)) <= set(zip(t, y, strict=True))
    assert (drawn_y.max(), drawn_y.min()) == (9.0, -9.0)


def test_labelled_axis_has_room_for_numbers_of_many_digits():
    line = Line(np.arange(50.0), 4.9e-4 + 1e-7 * np.arange(50.0))
    panels = tuple(Panel((line,), label, timed=False, column=k) for k, label in enumerate(("position [m]", "")))
    layout = figure(Plot(panels, "", 3.0))["layout"]
    assert layout["yaxis"]["automargin"]
    assert "automargin" not in layout["yaxis2"]
