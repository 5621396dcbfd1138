"""Faults of the environment and of input files, through the real command: one line, no traceback, no files left."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

HOVER = Path.cwd() / "lapwing/scenes/hover.toml"
SHORT = ["--mode", "single-process", "--set", "run.duration=0.2", "--set", "success.require=[]"]


def lapwing(folder, *arguments, **environment):
    command = [sys.executable, "-m", "lapwing", *map(str, arguments)]
    environment = {**os.environ, "PYTHONPATH": str(Path.cwd()), **environment}
    return subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, timeout=120, check=False
    )


def check_rejected(result, message, code=2):
    assert (result.returncode, result.stdout, result.stderr.count("\n")) == (code, "", 1), result.stderr
    assert result.stderr.startswith("lapwing: ")
    assert message in result.stderr


def test_log_that_is_device_is_rejected(tmp_path):
    result = lapwing(tmp_path, "run", HOVER, *SHORT, "--log", "/dev/null", "--report", "a.html")
    check_rejected(result, "/dev/null: is not a regular file")
    assert not list(tmp_path.iterdir())


@pytest.mark.long
@pytest.mark.parametrize("device", ["fifo", "/dev/zero"])
@pytest.mark.parametrize("command", ["check", "run"])
def test_scene_that_is_device_is_rejected(tmp_path, command, device):
    os.mkfifo(tmp_path / "fifo")
    check_rejected(lapwing(tmp_path, command, device), f"{device}: is not a regular file")


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
    check_rejected(lapwing(tmp_path, *command, device), f"{device}: ")
    assert [path.name for path in tmp_path.iterdir()] == ["fifo"]


@pytest.mark.long
@pytest.mark.parametrize(
    ("content", "message"),
    [('{"fileType": "Plan", "mission": {}}', "key 'items' is missing"), ("[1]", "wrong type"), ("{", "neither JSON")],
)
def test_broken_plan_is_rejected(tmp_path, content, message):
    (tmp_path / "broken.plan").write_text(content)
    check_rejected(lapwing(tmp_path, "run", HOVER, "--plan", "broken.plan"), message)


@pytest.mark.long
@pytest.mark.parametrize("preset", ['["0.1"]', "{a=1}", "3"])
def test_sensor_preset_of_another_type_is_rejected(tmp_path, preset):
    result = lapwing(tmp_path, "check", "delivery_mission", "--set", f"sensors.imu.preset={preset}")
    check_rejected(result, "sensors.imu.preset: unknown preset")


def test_deleted_working_directory_is_rejected(tmp_path):
    folder = tmp_path / "gone"
    folder.mkdir()
    script = f'rmdir "{folder}"; exec "{sys.executable}" -m lapwing scenes'
    environment = os.environ | {"PYTHONPATH": str(Path.cwd())}
    result = subprocess.run(
        ["sh", "-c", script], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    check_rejected(result, "working directory: does not exist")


@pytest.mark.parametrize("arguments", [["--log", b"\xff.mcap"], ["--report", b"\xff.html"], ["--json", b"\xff.json"]])
def test_name_that_is_not_utf8_is_rejected_before_flight(tmp_path, arguments):
    arguments = [os.fsdecode(argument) if isinstance(argument, bytes) else argument for argument in arguments]
    check_rejected(lapwing(tmp_path, "run", HOVER, *SHORT, *arguments), "not valid utf-8; use another name")
    assert not list(tmp_path.iterdir())


def test_working_directory_that_is_not_utf8_is_rejected(tmp_path):
    folder = tmp_path / os.fsdecode(b"\xff")
    folder.mkdir()
    check_rejected(lapwing(folder, "run", HOVER, *SHORT), "working directory")
    assert not list(folder.iterdir())


def test_name_that_locale_cannot_express_is_rejected_before_flight(tmp_path):
    ascii_only = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    result = lapwing(tmp_path, "run", HOVER, *SHORT, "--log", "ä.mcap", **ascii_only)
    check_rejected(result, "not valid ascii; use another name, or a UTF-8 locale")
    assert not list(tmp_path.iterdir())


@pytest.mark.long
def test_run_prints_in_ascii(tmp_path):
    result = lapwing(tmp_path, "run", HOVER, *SHORT, "--log", "ä.mcap", PYTHONIOENCODING="ascii")
    assert result.returncode == 0, result.stderr
    assert "roll [\\xb0]" in result.stdout
    assert (tmp_path / "ä.mcap").exists()


@pytest.mark.long
@pytest.mark.skipif(os.geteuid() == 0 and not Path("/proc/self/fd").exists(), reason="needs /proc")
def test_log_in_folder_without_write_access_is_rejected(tmp_path):
    check_rejected(lapwing(tmp_path, "run", HOVER, *SHORT, "--log", "/proc/a.mcap"), "/proc/a.mcap: cannot be written")
    check_rejected(lapwing("/proc/self/fd", "run", HOVER, *SHORT), "cannot be written")
