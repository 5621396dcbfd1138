"""Parameter files: saved from a scene or a run, read back, rejected in one line."""

from pathlib import Path

import pytest

from lapwing.cosim.scene import SceneError
from lapwing.messages import OperatorCommand
from lapwing.runs.single_process_run import fly_single
from lapwing.services.autopilot.parameter_file import read, write
from lapwing.services.common.autopilot_parameters import table
from lapwing.services.scene_resolver import load, resolve
from tests.commands import assert_rejected, run_command

HOVER = Path("lapwing/scenes/hover.toml")
OPERATED = ["autopilot.accept_commands=true", "autopilot.follow_trajectory=false", "run.duration=1.0"]


def test_parameter_file_round_trip(tmp_path):
    path = tmp_path / "mine.params"
    known = table(load(HOVER))
    values = {name: p.default for name, p in known.items()} | {"PID_ROLL_P": known["PID_ROLL_P"].default * 0.5}
    write(path, known.values(), values)
    assert read(path) == values
    scene = load(HOVER, [f"autopilot.parameters={path}"])
    assert table(scene)["PID_ROLL_P"].default == values["PID_ROLL_P"]
    assert len(path.read_text().splitlines()[3].split("\t")) == 5  # as QGroundControl reads it


def test_mavproxy_rows_are_read(tmp_path):
    path = tmp_path / "mine.parm"
    path.write_text("# saved\nMPC_XY_CRUISE    3.000000\nNAV_DLL_ACT 2\n")
    assert read(path) == {"MPC_XY_CRUISE": 3.0, "NAV_DLL_ACT": 2.0}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("MPC_XY_CRUISE fast", "bad.params:1: MPC_XY_CRUISE: expected a number, got 'fast'"),
        ("one two three", "bad.params:1: expected name and value"),
        ("MPC_XY_CRUISE 1e9", "MPC_XY_CRUISE: expected a number from 0.1 to 20, got 1e\\+09"),
        ("MPC_XY_CRUISE nan", "MPC_XY_CRUISE: expected a finite number, got nan"),
        ("NO_SUCH 1", "bad.params: autopilot.parameters.NO_SUCH: unknown parameter"),
    ],
)
def test_invalid_parameter_file_is_rejected_in_one_line(tmp_path, text, message):
    path = tmp_path / "bad.params"
    path.write_text(text)
    with pytest.raises(SceneError, match=message) as caught:
        load(HOVER, [f"autopilot.parameters={path}"])
    assert "\n" not in str(caught.value)


def test_final_parameters_of_run_are_saved(tmp_path):
    def set_(name, value):
        return OperatorCommand("parameter", "test", 1, (value,), name)

    values = {
        5: [set_("MPC_XY_CRUISE", 3.5), set_("MPC_XY_CRUISE", 1e9), set_("NO_SUCH", 1.0)],
        20: [set_("NAV_DLL_ACT", 3.0)],
    }
    log, saved = tmp_path / "run.mcap", tmp_path / "after.params"
    fly_single(resolve(load(HOVER, OPERATED)), log, operator=lambda tick: values.get(tick, ()))
    result = run_command("parameters", log, "--save", saved, code=0)
    after = read(saved)
    assert (after["MPC_XY_CRUISE"], after["NAV_DLL_ACT"]) == (3.5, 3.0)
    assert "MPC_XY_CRUISE    3.5" in result.stdout
    assert table(load(HOVER, [f"autopilot.parameters={saved}"]))["MPC_XY_CRUISE"].default == 3.5


@pytest.mark.long
def test_scene_without_autopilot_has_no_parameters(tmp_path):
    assert_rejected(run_command("parameters", "lapwing/scenes/os4_motors.toml"), "no autopilot")


@pytest.mark.long
def test_command_takes_name_of_shipped_scene(tmp_path):
    saved = tmp_path / "hover.params"
    result = run_command("parameters", "hover", "--save", saved)
    assert (result.returncode, result.stderr) == (0, "")
    assert read(saved) == {name: p.default for name, p in table(load(HOVER)).items()}


@pytest.mark.long
@pytest.mark.parametrize(
    ("file", "message"),
    [("hovr", "unknown scene 'hovr'"), ("missing.mcap", "cannot be read: no such file or directory; expected a log")],
)
def test_command_rejects_missing_scene_or_log_in_one_line(file, message):
    assert_rejected(run_command("parameters", file), message)
