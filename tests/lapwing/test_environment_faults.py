"""Faults of the environment and of input files, through the real command: one line, no traceback, no files left."""

import os
from pathlib import Path

import pytest

from tests.commands import assert_rejected, run_command

HOVER = Path.cwd() / "lapwing/scenes/hover.toml"
SHORT = ["--mode", "single-process", "--set", "run.duration=0.2", "--set", "success.require=[]"]


def test_log_that_is_device_is_rejected(tmp_path):
    result = run_command("run", HOVER, *SHORT, "--log", "/dev/null", "--report", "a.html", folder=tmp_path)
    assert_rejected(result, "/dev/null: is not a regular file")
    assert not list(tmp_path.iterdir())


@pytest.mark.long
@pytest.mark.parametrize("device", ["fifo", "/dev/zero"])
@pytest.mark.parametrize("command", ["check", "run"])
def test_scene_that_is_device_is_rejected(tmp_path, command, device):
    os.mkfifo(tmp_path / "fifo")
    assert_rejected(run_command(command, device, folder=tmp_path), f"{device}: is not a regular file")


@pytest.mark.long
@pytest.mark.parametrize("device", ["fifo", "/dev/zero"])
@pytest.mark.parametrize(
    "command",
    [
        ["info"],
        ["report"],
        ["performance"],
        ["run", HOVER, "--plan"],
        ["campaign", HOVER, "--sweep"],
        ["run", HOVER, "--mavlink", "udpout:127.0.0.1:9", "--mavlink-key"],
        ["import", "--out", "a.mcap"],
    ],
)
def test_input_file_that_is_device_is_rejected(tmp_path, command, device):
    os.mkfifo(tmp_path / "fifo")
    assert_rejected(run_command(*command, device, folder=tmp_path), f"{device}: ")
    assert [path.name for path in tmp_path.iterdir()] == ["fifo"]


@pytest.mark.long
@pytest.mark.parametrize(
    ("content", "message"),
    [('{"fileType": "Plan", "mission": {}}', "key 'items' is missing"), ("[1]", "wrong type"), ("{", "neither JSON")],
)
def test_broken_plan_is_rejected(tmp_path, content, message):
    (tmp_path / "broken.plan").write_text(content)
    assert_rejected(run_command("run", HOVER, "--plan", "broken.plan", folder=tmp_path), message)


@pytest.mark.long
@pytest.mark.parametrize("preset", ['["0.1"]', "{a=1}", "3"])
def test_sensor_preset_of_another_type_is_rejected(tmp_path, preset):
    result = run_command("check", "delivery_mission", "--set", f"sensors.imu.preset={preset}", folder=tmp_path)
    assert_rejected(result, "sensors.imu.preset: unknown preset")


def test_deleted_working_directory_is_rejected(tmp_path):
    folder = tmp_path / "gone"
    folder.mkdir()
    done = run_command("scenes", folder=folder, within=["sh", "-c", f'rmdir "{folder}"; exec "$@"', "sh"])
    assert_rejected(done, "working directory: does not exist")


@pytest.mark.parametrize("arguments", [["--log", b"\xff.mcap"], ["--report", b"\xff.html"], ["--json", b"\xff.json"]])
def test_name_that_is_not_utf8_is_rejected_before_flight(tmp_path, arguments):
    arguments = [os.fsdecode(argument) if isinstance(argument, bytes) else argument for argument in arguments]
    assert_rejected(run_command("run", HOVER, *SHORT, *arguments, folder=tmp_path), "not valid utf-8; use another name")
    assert not list(tmp_path.iterdir())


def test_working_directory_that_is_not_utf8_is_rejected(tmp_path):
    folder = tmp_path / os.fsdecode(b"\xff")
    folder.mkdir()
    assert_rejected(run_command("run", HOVER, *SHORT, folder=folder), "working directory")
    assert not list(folder.iterdir())


def test_name_that_locale_cannot_express_is_rejected_before_flight(tmp_path):
    ascii_only = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    result = run_command("run", HOVER, *SHORT, "--log", "ä.mcap", **ascii_only, folder=tmp_path)
    assert_rejected(result, "not valid ascii; use another name, or a UTF-8 locale")
    assert not list(tmp_path.iterdir())


@pytest.mark.long
def test_run_prints_in_ascii(tmp_path):
    result = run_command("run", HOVER, *SHORT, "--log", "ä.mcap", PYTHONIOENCODING="ascii", folder=tmp_path, code=0)
    assert "roll [\\xb0]" in result.stdout
    assert (tmp_path / "ä.mcap").exists()


@pytest.mark.long
@pytest.mark.skipif(os.geteuid() == 0 and not Path("/proc/self/fd").exists(), reason="needs /proc")
def test_log_in_folder_without_write_access_is_rejected(tmp_path):
    assert_rejected(
        run_command("run", HOVER, *SHORT, "--log", "/proc/a.mcap", folder=tmp_path), "/proc/a.mcap: cannot be written"
    )
    assert_rejected(run_command("run", HOVER, *SHORT, folder="/proc/self/fd"), "cannot be written")
