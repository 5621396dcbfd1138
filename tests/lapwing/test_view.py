"""`lapwing view` opens the page, or Rerun, whose converter prints no warning."""

import subprocess
import webbrowser

import pytest

import lapwing as package
from lapwing.views import rerun_export as rerun
from tests.commands import assert_rejected


def _fly(scene, folder):
    """Return the log of one second of a scene."""
    return package.fly(package.load_scene(scene, {"run.duration": 1.0})).save(folder / f"{scene}.mcap")


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    return _fly("hover", tmp_path_factory.mktemp("view"))


@pytest.mark.parametrize("there", [True, False])
def test_page_is_written_and_opened(lapwing, log, monkeypatch, there):
    opened = []
    monkeypatch.setattr(webbrowser, "open", lambda address: opened.append(address) or there)
    code, out, err = lapwing("view", log)
    page = log.with_suffix(".html")
    assert (code, err, opened) == (0, "", [page.as_uri()])
    assert out.splitlines() == [*([] if there else ["no browser found; open this page:"]), str(page)]
    assert 'id="space"' in page.read_text(encoding="utf-8")


def test_invalid_log_is_rejected_in_one_line(lapwing, log, monkeypatch, tmp_path):
    monkeypatch.setattr(rerun, "program", lambda: None)
    (tmp_path / "text.mcap").write_text("no log")
    for arguments, output in (
        (["none.mcap"], "none.mcap: cannot be read: no such file or directory; expected a log"),
        (["none.mcap", "--rerun"], "none.mcap: cannot be read: no such file or directory; expected a log"),
        (["text.mcap"], "text.mcap: not an MCAP file"),
        ([log, "--rerun"], "Rerun is not installed; pip install lapwing[view]"),
    ):
        assert_rejected(lapwing("view", *arguments), output)


@pytest.mark.long
@pytest.mark.skipif(rerun.program() is None, reason="needs Rerun (pip install rerun-sdk)")
def test_rerun_converts_log_of_all_sensors_without_warning(tmp_path):
    log = _fly("delivery_mission", tmp_path)
    command = [rerun.program(), "mcap", "convert", str(log), "-o", str(tmp_path / "mission.rrd")]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    # Rerun derives the recording's name from the file's and prints a message if it has a dot.
    output = [line for line in done.stderr.splitlines() if "WARN" in line and "Application ID" not in line]
    assert output == []


@pytest.mark.skipif(rerun.program() is None, reason="needs Rerun (pip install lapwing[view])")
def test_rerun_opens_recording_that_begins_with_blueprint(lapwing, monkeypatch, tmp_path):
    pytest.importorskip("rerun")
    log = _fly("delivery_mission", tmp_path)
    started = []
    monkeypatch.setattr(subprocess, "Popen", lambda command, **_: started.append(command))
    code, out, err = lapwing("view", log, "--rerun")
    recording = log.with_suffix(".rrd")
    assert (code, out, err) == (0, f"{recording}\n", "")
    assert started == [[rerun.program(), "--bind", "127.0.0.1", str(recording)]]
    monkeypatch.undo()
    command = [rerun.program(), "rrd", "print", "-vv", str(recording)]
    reported = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert reported.index("Blueprint,") < reported.index("Recording,")
    assert reported.count(f'"{rerun.APPLICATION}"') >= 2
    for topic in ("/tf", "/drone1/pose", "/drone1/battery", "/drone1/gps/fix", "/drone1/sonar"):
        assert f" - {topic} - " in reported
