"""Numbers and trouble at the top of a report, and a click on an event."""

import re

import numpy as np
import pytest
import synthetic_flights

from lapwing.flights.flight_events import Event, with_crash
from lapwing.services.common.schemas.run_schema import published_figures
from lapwing.services.scene_resolver import load
from lapwing.views.report import write
from lapwing.views.report.key_numbers import key_numbers, trouble
from lapwing.views.report.sections import labels
from lapwing.views.studies.effects_result import format_percent
from lapwing.views.view3d import headless

TICKS, RATE = 400, 100


def flight():
    """Return a flight 0.3 m east and 0.4 m north of its reference."""
    position = np.tile((0.3, 0.4, 2.0), (TICKS, 1))
    position[:, 2] += np.arange(TICKS) / RATE
    truth = {
        "pose.position": position,
        "pose.orientation": synthetic_flights.LEVEL,
        "rotor_speed": (1.0,) * 4,
        **dict.fromkeys(("motor_voltage", "motor_current", "rotor_thrust", "rotor_torque"), (1.0,) * 4),
        "motor_power": (900.0,) * 4,
        "velocity": (0.0, 0.0, 1.0),
        "acceleration": (0.0,) * 3,
        "air_density": 1.2,
        "wind": (0.0,) * 3,
        "ground_contact": np.zeros(TICKS, bool),
    }
    setpoint = {"position": position - (0.3, 0.4, 0.0), "yaw": 0.0, "phase": np.full(TICKS, "climb", object)}
    actuators = {"attitude_reference": (0.0, 0.0, 0.0), "armed": np.ones(TICKS, bool), "motor_voltage": (1.0,) * 4}
    scene = {"published": {"rmse": {"x": 0.1, "y": 0.1, "z": 0.1}, "source": "paper"}}
    result = synthetic_flights.flight(
        TICKS, RATE, scene=scene, ground_truth=truth, setpoint=setpoint, actuators=actuators
    )
    result.digest = "0" * 32
    result.events = [Event(1.0, "phase", "climb"), Event(2.0, "fault", "<b>rotor 1</b> fails")]
    return result


def test_error_above_published_value_is_marked():
    error, largest, *_ = key_numbers(flight())
    assert (error.value, error.limit, error.mark) == (pytest.approx(0.5), pytest.approx(0.03**0.5), "bad")
    assert largest.value == pytest.approx(0.5)
    assert largest.mark == ""
    assert (error.text, error._replace(value=8.412e-5).text) == ("0.5 m", "0.0841 mm")


def test_trouble_lists_faults_without_phases():
    assert [event.kind for event in trouble(flight())] == ["fault"]


def test_trouble_names_crash_at_its_time():
    crashed = flight()
    crashed.outcome = crashed.outcome._replace(kind="crashed", time=1.5, how="turned over")
    crashed.events = with_crash(crashed.events, crashed.outcome)
    assert [(event.time, event.kind, event.text) for event in trouble(crashed)] == [
        (1.5, "crash", "turned over"),
        (2.0, "fault", "after the crash: <b>rotor 1</b> fails"),
    ]
    crashed.origin.scene["published"]["rmse"] = dict.fromkeys("xyz", 1.0)
    assert "good" not in [number.mark for number in key_numbers(crashed)]


def test_report_names_missed_criteria_of_scene(tmp_path):
    values = flight()
    values.origin.scene["success"] = {
        "require": ["max_distance < 0.4", "rmse.x < 1", "outcome in ('landed', 'completed')"]
    }
    text = write(values, tmp_path / "a.html").read_text(encoding="utf-8")
    assert text.count("Not met: ") == 1
    assert "Not met: max_distance &lt; 0.4<" in text
    assert '<p class="missing">Met: rmse.x &lt; 1</p>' in text
    assert '<p class="outcome bad"><strong>Failed.</strong> ' in text  # though the flight itself went well


def test_end_of_failsafe_is_no_trouble():
    values = flight()
    values.events = [Event(1.0, "failsafe", "no GPS"), Event(2.0, "failsafe", "no GPS: over")]
    assert [event.time for event in trouble(values)] == [1.0]


def test_position_at_the_end_has_no_negative_zero():
    outcome = flight().outcome._replace(kind="landed", position=(-0.001, 0.001, 0.1))
    assert "ends at (0.00, 0.00, 0.10) m" in str(outcome)


def test_number_without_limit_is_neither_good_nor_bad(tmp_path):
    text = write(flight(), tmp_path / "a.html").read_text(encoding="utf-8")
    assert '<div class="bad"><dt>position error, RMS</dt>' in text
    assert "<div><dt>largest distance from reference</dt>" in text


def test_numbers_of_fleet_name_their_vehicle(tmp_path):
    first, other = flight(), flight()
    first.events, other.vehicle = [Event(1.0, "phase", "climb")], "drone2"
    first.others, first.fleet = (other,), {one.vehicle: one.truth for one in (first, other)}
    text = write(first, tmp_path / "a.html").read_text(encoding="utf-8")
    assert '<p class="missing">drone1:</p>' in text
    assert "drone1: no faults, failsafes or warnings." in text
    assert "1 event</h2>" in text


def test_report_begins_with_verdict_numbers_and_escaped_trouble(tmp_path):
    text = write(flight(), tmp_path / "a.html").read_text(encoding="utf-8")
    places = [
        text.index(part)
        for part in ('id="outcome"', 'class="numbers"', 'class="trouble"', 'id="mission_map"', 'id="space"')
    ]
    assert places == sorted(places)
    assert "<b>rotor" not in text
    assert "beyond 0.173 m (paper)" in text


def test_flights_of_comparison_have_their_names():
    one, other = flight(), flight()
    one.name, other.name = "PID", "Lee"
    assert labels([one, other]) == ("PID", "Lee")


@pytest.mark.parametrize(("share", "text"), [(-1.0, "-100 %"), (0.123, "+12 %"), (0.0123, "+1.2 %"), (0.0, "0 %")])
def test_percent_has_no_exponent(share, text):
    assert format_percent(share) == text


@pytest.mark.long
@pytest.mark.skipif(headless.PROGRAM is None, reason="needs Chromium")
def test_click_on_event_moves_plots(tmp_path):
    page = write(flight(), tmp_path / "a.html")
    with headless.Browser(page) as browser:
        ranges = browser.run(
            """
            const until = async (holds) => {
              for (let k = 0; k < 1200 && !holds(); k++) await new Promise((done) => setTimeout(done, 50));
              if (!holds()) throw new Error(`never: ${holds}`);
            };
            await until(() => document.readyState === "complete");
            const figure = document.querySelector("#position figure");
            figure.scrollIntoView();
            await until(() => figure.querySelector(".js-plotly-plot")?.layout);
            document.querySelector(".trouble button").click();
            const range = () => figure.querySelector(".js-plotly-plot").layout.xaxis.range;
            await until(() => range()[0] === -3);
            return range();
            """
        )
        assert browser.errors == []
    assert ranges == pytest.approx([-3.0, 12.0])  # 5 s before the fault at 2 s to 10 s after it
    assert re.search(r'data-time="2.0"', page.read_text(encoding="utf-8"))


def test_published_errors_are_shown_for_their_airframe_only():
    assert published_figures(load("delivery_mission").resolved)["source"] == "paper, Table 7"
    assert not published_figures(load("delivery_mission", ["vehicle.airframe=racer_250"]).resolved)
