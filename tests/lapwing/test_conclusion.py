"""What a run says at its end: the verdict in terminal, report and JSON, and the exit code."""

import json
import signal
from pathlib import Path

import pytest

import lapwing as package
from lapwing.runs import single_process_run
from lapwing.studies.flight_data import SHOWN, FlightData
from lapwing.studies.metrics import figures
from lapwing.studies.report.page import flight_page

HOVER = ["run", "hover", "--mode", "single", "--log", "a.mcap", "--json", "a.json"]
FALL = 'trajectory.phase.2.z={kind="ramp", to=-12.0, rate=8.0}'
RUN_AWAY = ["gyrostat.cubic_gain=[-1e250, -1e250, -1e250]", "run.duration=1.0"]


def sets(*texts):
    return [part for text in texts for part in ("--set", text)]


def test_a_landing_is_told_with_speed_place_events_and_degrees(lapwing):
    code, out, err = lapwing(*HOVER)
    assert (code, err) == (0, "")
    assert "Landed at 8.52 s: upright on its feet, touched down at 0.95 m/s; ends at (0.00," in out
    assert "0.10  contact  leaves the ground" in out
    assert "roll [°]" in out
    told = json.loads(Path("a.json").read_text())
    assert (told["verdict"]["kind"], told["landed"]) == ("landed", True)
    assert {"time": 6.0, "kind": "phase", "text": "descend"} in told["events"]
    page = Path("a.html").read_text()
    assert "Landed at 8.52 s" in page
    assert "<td>leaves the ground</td>" in page


def test_a_crash_is_no_landing_and_ends_with_its_own_exit_code(lapwing):
    code, out, err = lapwing(*HOVER, *sets(FALL))
    assert (code, err) == (4, "lapwing: the flight has failed: crashed; success.require: verdict != 'crashed'\n")
    assert "hit the ground at 4.4 m/s" in out
    told = json.loads(Path("a.json").read_text())
    assert (told["verdict"]["kind"], told["landed"]) == ("crashed", False)
    assert "Crashed at " in Path("a.html").read_text()


@pytest.mark.parametrize(
    ("require", "code"), [("verdict == 'landed'", 4), ("rmse.z < 0.1 and abs(time - 2) < 1e-6", 0), ("energy < 9", 4)]
)
def test_the_scene_says_what_is_a_success(lapwing, require, code):
    found, out, _ = lapwing(*HOVER, *sets("run.duration=2.0", f'success.require=["{require}"]'))
    assert found == code
    assert "Timed out at 2.00 s: the mission was not over, in mission (climb)" in out


@pytest.mark.parametrize("mode", ["single", "processes"])
def test_a_divergence_has_its_verdict_in_both_modes(lapwing, mode):
    code, out, err = lapwing(
        *("run", "gyrostat_feedback", "--mode", mode, "--key-prefix", "test-diverge", "--log", "a.mcap"),
        *sets(*RUN_AWAY),
    )
    assert (code, err) == (4, "lapwing: the flight has failed: diverged; success.require: verdict != 'diverged'\n")
    assert "Diverged at 0.00 s: gyrostat: not finite at t = 1 s" in out
    assert FlightData.read("a.mcap").verdict.kind == "diverged"


def test_ctrl_c_has_its_verdict_too(lapwing, monkeypatch):
    advance = single_process_run.run_single

    def interrupted(graph, recording, speed, observe, last):
        advance(graph, recording, speed, lambda graph: signal.raise_signal(signal.SIGINT) or observe(graph), 500)

    monkeypatch.setattr(single_process_run, "run_single", interrupted)
    code, out, err = lapwing(*HOVER)
    assert (code, err) == (130, "lapwing: ended by SIGINT\n")
    assert "Broken off at 2.00 s: ended by SIGINT" in out
    assert FlightData.read("a.mcap").verdict.kind == "broken off"
    assert Path("a.html").exists()


def test_a_run_that_is_refused_says_nothing_of_the_log_that_was_there(lapwing, monkeypatch):
    lapwing(*HOVER)
    monkeypatch.setattr(single_process_run, "create_all", lambda *_: signal.raise_signal(signal.SIGTERM))
    assert lapwing(*HOVER)[1:] == ("", "lapwing: ended by SIGTERM\n")


@pytest.mark.parametrize("scene", ["delivery_mission", "cooperative_load"])
def test_what_the_end_of_a_run_reads_is_all_that_it_shows(tmp_path, scene):
    """Of a log with every sensor only the topics that page, figures and events are made of."""
    log = package.fly(package.load(scene, {"run.duration": 2.0})).save(tmp_path / "a.mcap")
    (part,), whole = FlightData.read_all(log, SHOWN), FlightData.read(log)
    assert set(part.topics) < set(whole.topics)
    assert flight_page([part]) == flight_page([whole]) == flight_page([FlightData.read(log, only=SHOWN)])
    assert part.events == whole.events
    assert str(figures(part)) == str(figures(whole))  # as texts: some are NaN
