"""End of a run: outcome in terminal, report and JSON, and the exit code."""

import json
import re
import signal
from pathlib import Path

import pytest

import lapwing as package
from lapwing.flights.flight_data import SHOWN, FlightData
from lapwing.flights.metrics import metrics
from lapwing.runs import single_process_run
from lapwing.views.report.key_numbers import key_numbers
from lapwing.views.report.page import flight_page

HOVER = ["run", "hover", "--mode", "single-process", "--log", "a.mcap", "--json", "a.json"]
FALL = 'trajectory.phase.2.z=[{kind="ramp", to=-12.0, rate=8.0}, {kind="ramp", to=0.0, rate=8.0}]'
RUN_AWAY = ["gyrostat.cubic_gain=[-1e250, -1e250, -1e250]", "run.duration=1.0"]


def sets(*texts):
    return [part for text in texts for part in ("--set", text)]


def test_landing_summary_has_speed_place_events_degrees(lapwing):
    code, out, err = lapwing(*HOVER)
    assert (code, err) == (0, "")
    text = " ".join(out.split())
    landing = re.search(
        r"Landed at (\S+) s: upright on its feet, touched down at (\S+) m/s \(commanded (\S+)\)(.*?); ends at", text
    )
    assert landing, text
    touched, commanded = float(landing[2]), float(landing[3])
    assert (landing[4] == ", harder than commanded") == (touched > max(1.1 * commanded, 0.1) + 0.005), landing[0]
    assert "roll [°]" in out
    reported = json.loads(Path("a.json").read_text())
    assert (reported["outcome"]["kind"], reported["landed"]) == ("landed", True)
    assert reported["outcome"]["mark"] == ("warn" if landing[4] else "good")
    times = {event["text"]: event["time"] for event in reported["events"]}
    assert times["armed"] <= times["leaves the ground"]
    truth = FlightData.read("a.mcap")
    assert times["armed"] == truth.actuators.times[truth.actuators.armed][0]
    assert times["disarmed"] == pytest.approx(truth.actuators.times[truth.actuators.armed][-1] + 0.004)
    assert {"time": 6.0, "kind": "phase", "text": "descend"} in reported["events"]
    page = Path("a.html").read_text()
    assert f"Landed at {landing[1]} s" in page
    assert "<td>leaves the ground</td>" in page


def test_crash_has_separate_exit_code(lapwing):
    code, out, err = lapwing(*HOVER, *sets(FALL))
    assert (code, err.count("\n")) == (4, 1)
    assert "crashed; success.require: outcome in" in err
    assert out.index("Crashed at ") < out.index("time [s]")
    assert re.search(
        r"the setpoint led into the ground: hit the ground at 4\.4\d m/s \(commanded 8\.00, limit 2\)",
        " ".join(out.split()),
    )
    reported = json.loads(Path("a.json").read_text())
    assert (reported["outcome"]["kind"], reported["landed"]) == ("crashed", False)
    page = Path("a.html").read_text()
    assert "Crashed at " in page
    assert 'class="good"' not in page
    assert "good" not in [number.mark for number in key_numbers(FlightData.read("a.mcap"))]


@pytest.mark.parametrize(
    ("require", "code"), [("outcome == 'landed'", 4), ("rmse.z < 0.1 and abs(time - 2) < 1e-6", 0), ("energy < 9", 4)]
)
def test_success_criteria_decide_exit_code(lapwing, require, code):
    result, out, _ = lapwing(*HOVER, *sets("run.duration=2.0", f'success.require=["{require}"]'))
    assert result == code
    assert "Completed at 2.00 s: the run ends before its trajectory" in out


@pytest.mark.parametrize("mode", ["single-process", "multi-process"])
def test_divergence_is_reported_in_both_modes(lapwing, mode):
    code, out, err = lapwing(
        *("run", "gyrostat_feedback", "--mode", mode, "--key-prefix", "test-diverge", "--log", "a.mcap"),
        *sets(*RUN_AWAY),
    )
    assert (code, err.count("\n")) == (4, 1)
    assert "diverged; success.require: outcome in" in err
    assert "Diverged at 0.00 s: gyrostat: not finite at t = 1 s" in out
    assert FlightData.read("a.mcap").outcome.kind == "diverged"


def test_interrupted_run_is_aborted_with_report(lapwing, monkeypatch):
    advance = single_process_run.run_single

    def interrupted(diagram, recording, speed, observe, last):
        advance(diagram, recording, speed, lambda diagram: signal.raise_signal(signal.SIGINT) or observe(diagram), 500)

    monkeypatch.setattr(single_process_run, "run_single", interrupted)
    code, out, err = lapwing(*HOVER)
    assert (code, err) == (130, "lapwing: ended by SIGINT\n")
    assert "Aborted at 2.00 s: the run was ended" in out
    assert FlightData.read("a.mcap").outcome.kind == "aborted"
    assert Path("a.html").exists()


def test_run_that_fails_early_ignores_older_log(lapwing, monkeypatch):
    lapwing(*HOVER)
    monkeypatch.setattr(single_process_run, "create_all", lambda *_: signal.raise_signal(signal.SIGTERM))
    assert lapwing(*HOVER)[1:] == ("", "lapwing: ended by SIGTERM\n")


@pytest.mark.long
@pytest.mark.parametrize("scene", ["delivery_mission", "cooperative_load"])
def test_end_of_run_reads_all_topics_that_it_shows(tmp_path, scene):
    """Page, metrics and events need only some topics of a log with all sensors."""
    log = package.fly(package.load_scene(scene, {"run.duration": 2.0})).save(tmp_path / "a.mcap")
    (part,), whole = FlightData.read_all(log, SHOWN), FlightData.read(log)
    assert set(part.topics) < set(whole.topics)
    assert flight_page([part]) == flight_page([whole]) == flight_page([FlightData.read(log, only=SHOWN)])
    assert part.events == whole.events
    assert str(metrics(part)) == str(metrics(whole))  # as texts: some are NaN


@pytest.mark.long
def test_run_that_ends_in_failsafe_fails(lapwing):
    fault = 'sensors.gps.faults=[{kind="dropout", start=5.0}]'
    code, out, err = lapwing("run", "delivery_mission", "--mode", "single-process", "--json", "a.json", *sets(fault))
    assert code == 4
    assert "ended in failsafe" in err
    outcome = json.loads(Path("a.json").read_text())["outcome"]
    assert outcome["kind"] == "ended in failsafe"
    assert outcome["failsafe"] in out
    assert outcome["target_distance"] > 1.0
