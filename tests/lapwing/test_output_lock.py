"""Locks of outputs: two processes never write the same file."""

import fcntl
import subprocess
import sys
from pathlib import Path

import pytest

from lapwing.cosim.log import LogReader, LogWriter
from lapwing.cosim.output_lock import OutputLock, is_locked, open_locked

SCENE = Path.cwd() / "lapwing/scenes/hover.toml"


def start(folder, *arguments):
    command = [sys.executable, "-m", "lapwing", *map(str, arguments)]
    return subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def test_open_locked_rejects_second_writer_and_keeps_content(tmp_path):
    path = tmp_path / "log"
    with open_locked(path) as file:
        file.write(b"first")
        assert is_locked(path)
        with pytest.raises(ValueError, match=f"{path}: another process"):
            open_locked(path)
        assert path.read_bytes() == b"first"
    assert not is_locked(path)
    open_locked(path).close()
    assert path.read_bytes() == b""


def test_writer_waits_for_the_end_of_a_look(tmp_path, monkeypatch):
    path = tmp_path / "log"
    look = path.open("w")
    fcntl.flock(look, fcntl.LOCK_SH)
    assert not is_locked(path)  # two looks do not disturb each other
    monkeypatch.setattr("time.sleep", lambda _: look.close())
    open_locked(path).close()


def test_shared_locks_exclude_exclusive_locks_only(tmp_path):
    first, second = OutputLock(tmp_path, shared=True), OutputLock(tmp_path, shared=True)
    with pytest.raises(ValueError, match="another process"):
        OutputLock(tmp_path)
    first.close()
    second.close()
    OutputLock(tmp_path).close()


@pytest.mark.parametrize("mode", ["single-process", "multi-process"])
def test_run_rejects_log_that_is_being_written(tmp_path, mode):
    log = tmp_path / "a.mcap"
    with LogWriter(log, {}, {}):
        size = log.stat().st_size
        run = start(tmp_path, "run", SCENE, "--mode", mode, "--log", log, "--key-prefix", f"test-lock-{mode}")
        message = run.communicate()[1]
        assert log.stat().st_size == size
    assert run.returncode == 2
    assert message.count("\n") == 1
    assert str(log) in message
    assert [path.name for path in tmp_path.iterdir()] == ["a.mcap"]


def test_run_names_log_of_run_that_has_only_claimed_its_report(tmp_path):
    """A run claims its report before its recorder opens the log."""
    log, report = tmp_path / "a.mcap", tmp_path / "a.html"
    report.touch()
    lock = OutputLock(report)
    run = start(tmp_path, "run", SCENE, "--mode", "single-process", "--log", log)
    message = run.communicate()[1]
    lock.close()
    assert run.returncode == 2
    assert message.startswith(f"lapwing: {log}: another process is writing it")
    assert message.count("\n") == 1


def test_simultaneous_runs_write_separate_logs(tmp_path):
    options = ["--mode", "single-process", "--set", "run.duration=1.0"]
    runs = [start(tmp_path, "run", SCENE, *options, "--set", f"run.seed={seed}") for seed in (1, 2)]
    for run in runs:
        assert run.communicate()[1] == ""
    logs = sorted((tmp_path / "recordings").glob("*.mcap"))
    seeds = set()
    for path in logs:
        with LogReader(path) as log:
            assert log.complete
            assert log.digest() == log.metadata["digest"]
            seeds.add(log.metadata["seed"])
    assert seeds == {"1", "2"}


def test_claimed_report_json_and_export_are_rejected_by_name(tmp_path):
    held = tmp_path / "held.json"
    held.touch()
    lock = OutputLock(held)
    run = start(tmp_path, "performance", "hover", "--json", held)
    message = run.communicate()[1]
    assert (run.returncode, held.name in message, message.count("\n")) == (2, True, 1)
    lock.close()


@pytest.mark.long
def test_campaign_rejects_folder_that_another_campaign_writes(tmp_path):
    arguments = ["campaign", SCENE, "--runs", "2", "--workers", "1", "--out", "c", "--set", "run.duration=1.0"]
    first = start(tmp_path, *arguments)
    assert first.communicate()[1] == ""
    lock = OutputLock(tmp_path / "c")
    second = start(tmp_path, *arguments)
    message = second.communicate()[1]
    assert second.returncode == 2
    assert "c: another process" in message
    lock.close()
