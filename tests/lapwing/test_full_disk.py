"""Full disk: one line, and a complete log of the data written before."""

import os
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

import lapwing
from lapwing.cosim.log import LogReader
from tests.commands import assert_rejected, run_command

pytestmark = pytest.mark.long

SCENE = Path.cwd() / "lapwing/scenes/hover.toml"
RUN = """
import os, resource, signal, sys
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
os.environ["LAPWING_COMMIT"] = "test"  # git is not asked: it would leave half of its index
resource.setrlimit(resource.RLIMIT_FSIZE, (BYTES, BYTES))
sys.argv = ["lapwing", "run", *sys.argv[1:], "--log", "full.mcap", "--key-prefix", "test-full"]
from lapwing.cli.main import main
main()
"""


def run(folder, size, mode, *options):
    code = textwrap.dedent(RUN).replace("BYTES", str(size))
    command = [sys.executable, "-c", code, str(SCENE), "--mode", mode, *options]
    return subprocess.run(command, capture_output=True, text=True, cwd=folder)


@pytest.mark.parametrize("size", [150_000, 160_000, 170_000])
def test_small_chunks_leave_room_for_the_end_of_the_log(tmp_path, size):
    done = run(tmp_path, size, "single-process", "--speed", "1")  # a chunk for each quarter of a second
    assert "cannot write the log: File too large" in done.stderr
    with LogReader(tmp_path / "full.mcap") as log:
        assert log.complete
        assert log.digest() == log.metadata["digest"]


@pytest.mark.parametrize("mode", ["single-process", "multi-process"])
def test_run_ends_with_one_line_and_complete_log(tmp_path, mode):
    done = run(tmp_path, 400_000, mode)  # the first chunk fits, the second does not
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "cannot write the log: File too large" in done.stderr
    with LogReader(tmp_path / "full.mcap") as log:
        assert log.complete
        assert "File too large" in log.metadata["failure"]
        assert log.digest() == log.metadata["digest"]
        times = [time_ns for topic, _, time_ns, _ in log.messages() if topic == "/drone1/ground_truth"]
    assert len(times) >= 100  # a chunk ends after a quarter of a second of wall time
    assert times == [k * 4_000_000 for k in range(len(times))]


def test_log_without_flight_data_is_deleted(tmp_path):
    done = run(tmp_path, 20_000, "single-process")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert list(tmp_path.iterdir()) == []


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    return lapwing.fly("hover").save(tmp_path_factory.mktemp("full") / "hover.mcap")


@pytest.mark.parametrize(
    ("words", "name"),
    [
        (("report", "LOG", "--out", "a.html"), "a.html"),
        (("report", "LOG", "--out", "a.pdf"), "a.pdf"),
        (("schema", "scene", "--out", "a.json"), "a.json"),
        (("protocol", "hover", "--json", "a.json"), "a.json"),
        (("report", "LOG", "--out", "a.png"), "a.png"),
    ],
)
def test_output_without_room_leaves_former_file(tmp_path, log, words, name):
    (tmp_path / name).write_text("former file")
    words = [log if word == "LOG" else word for word in words]
    done = run_command(*words, folder=tmp_path, within=["sh", "-c", 'ulimit -f 2; exec "$@"', "sh"])
    assert_rejected(done, f"lapwing: {name}: cannot be written: file too large\n")
    assert {file.name: file.read_text() for file in tmp_path.iterdir()} == {name: "former file"}


@pytest.mark.skipif(os.geteuid() != 0, reason="mounts a small disk, as root")
@pytest.mark.parametrize(("command", "name"), [("export-fmu", "a.fmu"), ("export-ssp", "a.ssp")])
def test_export_to_full_disk_leaves_no_file(tmp_path, command, name):
    (tmp_path / "disk").mkdir()
    part = ["--part", "plant"] if command == "export-fmu" else []
    script = 'mount -t tmpfs -o size=16k none disk && { "$@"; code=$?; ls -A disk; exit $code; }'
    small = ["unshare", "--mount", "sh", "-c", script, "sh"]
    done = run_command(command, "hover", *part, "--out", f"disk/{name}", folder=tmp_path, within=small)
    if "unshare" in done.stderr or "mount" in done.stderr:
        pytest.skip("needs the right to mount")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == f"lapwing: disk/{name}: cannot be written: no space left on device\n"
