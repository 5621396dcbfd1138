import re
from pathlib import Path

import numpy as np
import pytest
from page_texts import page_text
from rich.console import Console
from typer.testing import CliRunner

from lapwing.cli.main import app
from lapwing.flights.tracking import AXES
from lapwing.services.autopilot.gains import load
from lapwing.services.autopilot.stability_check import unstable_loops
from lapwing.services.scene_resolver import load as load_scene
from lapwing.studies.simulate import fly
from lapwing.studies.tune.bandwidths import Bandwidths
from lapwing.studies.tune.gain_refinement import MIN_RMSE, rmse
from lapwing.studies.tune.procedure import tune, write
from lapwing.views.studies.study_result import show, write_report
from lapwing.views.studies.tune_result import result as tune_result

pytestmark = pytest.mark.long

SCENES = Path(__file__).parents[3] / "lapwing/scenes"
HOVER = SCENES / "hover.toml"


@pytest.fixture(scope="module")
def tuning():
    return tune(load_scene(HOVER), Bandwidths(), lambda _: None)


def test_gain_file_can_be_read_and_flown(tuning, tmp_path):
    path = tmp_path / "new.toml"
    write(path, tuning.gains)
    assert load(str(path)) == tuning.gains
    flight = fly(load_scene(HOVER, [f"autopilot.gains={path}"]))
    assert flight.failure == ""
    height = flight.truth.position[:, 2]
    assert height.max() - height[0] == pytest.approx(1.0, abs=0.05)


def test_refinement_keeps_margins_and_reduces_errors(tuning):
    assert tuning.after.shortfalls == {}
    assert rmse(tuning.refinement.after, "z") < 0.9 * rmse(tuning.refinement.before, "z")
    refined, requested = tuning.refinement.bandwidths, Bandwidths()
    assert refined.altitude != requested.altitude
    assert refined.position == requested.position  # the flight does not move along x or y


def test_tuning_is_deterministic(tuning):
    assert tune(load_scene(HOVER), Bandwidths(), lambda _: None).gains == tuning.gains


def test_perturbed_vehicles_land(tuning):
    assert len(tuning.corners) == 8
    assert not [f["outcome_text"] for f in tuning.corners.values() if f["outcome"] != "landed"]
    assert max(f["max_distance"] for f in tuning.corners.values()) < 0.3
    assert len({f["max_distance"] for f in tuning.corners.values()}) == 8  # the corners are different vehicles


def test_page_and_tables(tuning, tmp_path):
    path = tmp_path / "tune.html"
    write_report(path, tune_result(tuning))
    page = page_text(path)
    assert page.count('<figure class="plot">') == 2
    assert "Open loops" in page
    assert "rise time" in page  # legend of the numbers in the panels
    assert "mass +20 %, inertia -20 %, thrust -20 %" in page
    worst = max(flight["max_distance"] for flight in tuning.corners.values())
    assert f"vehicles succeed, with position errors up to {worst:.2g} m (" in page
    console = Console(record=True, width=80)
    show(console, tune_result(tuning))
    text = console.export_text()
    assert "…" not in text  # no head or name is cut
    assert "_plant_input" not in text
    assert "_plant_input" not in page
    loop = "pitch with forward loop"
    rows = [[loop, *line.partition(loop)[2].split()] for line in text.splitlines() if loop in line]
    assert [row[1] for row in rows] == ["before", "new"]
    for row, review in zip(rows, (tuning.before, tuning.after), strict=True):
        m = review.margins["x_plant_input"]
        expected = (m.crossover, np.degrees(m.phase), 20.0 * np.log10(m.gain), 20.0 * np.log10(m.reduction))
        assert [float(text) for text in row[2:]] == pytest.approx(expected, abs=0.051)  # a number in each cell


def test_failing_gains_are_reported_and_require_force(tuning, tmp_path, monkeypatch):
    corner = next(iter(tuning.corners))
    crash = tuning.corners[corner] | {"outcome": "crashed", "outcome_text": "Crashed at 3.00 s: turned over"}
    failing = tuning._replace(corners=tuning.corners | {corner: crash})
    assert (tuning.failures, failing.failures) == ([], [f"{corner}: Crashed at 3.00 s: turned over"])
    monkeypatch.setattr("lapwing.studies.tune.procedure.tune", lambda *_: failing)
    out = tmp_path / "new.toml"
    result = CliRunner().invoke(app, ["tune", str(HOVER), "--out", str(out)])
    assert (result.exit_code, out.exists()) == (1, False)
    assert "Crashed at 3.00 s" in result.output
    assert "--force" in result.output
    assert result.output.count("Crashed at 3.00 s") == 2  # in the verdict and in the error
    result = CliRunner().invoke(app, ["tune", str(HOVER), "--out", str(out), "--force"])
    assert (result.exit_code, out.exists()) == (0, True)


def test_each_reason_of_a_failure_is_named_once(tuning):
    flights = [corner | {"outcome": "crashed", "outcome_text": "Crashed"} for corner in tuning.corners.values()]
    failing = tuning._replace(corners=dict(zip(tuning.corners, flights, strict=True)))
    assert failing.failures == [f"{next(iter(tuning.corners))}: Crashed (7 other vehicles: crashed)"]


def test_gain_sets_are_few_and_best_by_the_mean_of_all_axes(tuning):
    refinement = tuning.refinement
    assert refinement.gain_sets <= 24  # of three flights each: they are most of the cost
    axes = [axis for axis in AXES if rmse(refinement.before, axis) > MIN_RMSE]
    assert np.mean([rmse(refinement.after, axis) / rmse(refinement.before, axis) for axis in axes]) < 1.0


def test_weak_present_gains_raise_warning():
    output = []
    tune(load_scene(HOVER, ["autopilot.gains=paper"]), Bandwidths(), output.append)
    warnings = [line for line in output if line.startswith("warning: ")]
    assert len(warnings) == 1
    assert warnings[0].startswith("warning: present gains paper of the scene: ")
    assert "phase margin below 45 deg: roll, roll with sideways, pitch, pitch with forward loop" in warnings[0]


def gains_with(tmp_path, **changes):
    path = tmp_path / "changed.toml"
    write(path, load("tuned").model_copy(update=changes))
    return path


def test_check_warns_of_unstable_gains(tmp_path):
    path = gains_with(tmp_path, altitude=(160.0, 120.0, 3200.0))
    assert unstable_loops(load_scene(HOVER)) == []
    result = CliRunner().invoke(app, ["check", str(HOVER), "--set", f"autopilot.gains={path}"])
    assert result.exit_code == 0
    warnings = [line for line in result.output.splitlines() if "warning" in line]
    assert len(warnings) == 1
    assert "altitude loop unstable by 17.5 dB; lower altitude of gains " in warnings[0]


@pytest.mark.long
def test_force_flies_unstable_gains(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = gains_with(tmp_path, yaw=(2000.0, 0.1, 0.001))
    command = ["run", str(HOVER), "--set", f"autopilot.gains={path}", "--set", "run.duration=0.2"]
    result = CliRunner().invoke(app, [*command, "--mode", "single-process", "--force"])
    assert "lapwing: warning: yaw loop unstable" in result.output
    assert list(tmp_path.glob("recordings/*.mcap"))


def test_run_rejects_unstable_gains_before_take_off(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    too_high = tuple(30.0 * k for k in load("tuned").roll_inner)
    path = gains_with(tmp_path, roll_inner=too_high, yaw=(2000.0, 0.1, 0.001))
    command = ["run", str(HOVER), "--set", f"autopilot.gains={path}", "--mode", "single-process"]
    result = CliRunner().invoke(app, command)
    lines = result.output.splitlines()
    assert result.exit_code == 2
    assert len(lines) == 3  # an axis has one line, though three of its loops are unstable
    assert re.fullmatch(r"lapwing: yaw loop unstable.*; (lower|raise|change) yaw of gains changed.toml", lines[0])
    assert re.fullmatch(r"lapwing: roll loop unstable by [\d.]+ dB; lower roll_inner of gains changed.toml", lines[1])
    assert lines[2].endswith("unstable in hover; design others with lapwing tune, or use --force")
    assert max(map(len, lines)) <= 110
    assert [file.name for file in tmp_path.iterdir()] == [path.name]


def test_shipped_scenes_have_stable_gains():
    for path in sorted(SCENES.glob("*.toml")):
        scene = load_scene(path)
        for vehicle in scene.vehicles or (scene,):
            assert unstable_loops(vehicle) == [], path


def test_invalid_input_is_one_line(tmp_path):
    with pytest.raises(ValueError, match=r"^--altitude -1: expected a bandwidth above 0 rad/s$"):
        tune(load_scene(HOVER), Bandwidths(altitude=-1.0), lambda _: None)
    with pytest.raises(ValueError, match=r"has no \[autopilot\] to tune"):
        tune(load_scene(SCENES / "gyrostat_attitude.toml"), Bandwidths(), lambda _: None)
    for arguments, message in (
        (["--from", str(tmp_path / "no.mcap")], "no.mcap"),
        (["--report", "page.txt"], "--report page.txt: expected a name that ends in .html"),
        (["--out", "gains.txt"], "--out gains.txt: expected a name that ends in .toml"),
    ):
        result = CliRunner().invoke(app, ["tune", str(HOVER), *arguments])
        assert result.exit_code == 2
        assert message in result.output.replace("\n", "")
