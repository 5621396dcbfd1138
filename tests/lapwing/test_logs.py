"""`lapwing info`, `verify`, `recover` and `export` on synthetic logs."""

import csv
import json
import os
import signal
import subprocess
import sys
import textwrap

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer
from scipy.io import loadmat

from lapwing import fly
from lapwing.cosim.log import LogReader, LogWriter
from lapwing.messages import Clock, Point, Pose, Status, VehicleState, header, stamp
from tests.commands import assert_rejected, run_command

TICK = 4_000_000  # [ns]
ABOUT = {"scene": "made_up", "seed": "7", "version": "0.1", "solver_integrator": "rk4", "solver_step": "0.001"}


def write(path, ticks=500, from_tick=500, by=0.0, without=range(0), **about):
    """Write a log of a climb in which the vehicle drifts sideways from a tick on."""
    with LogWriter(path, ABOUT | about, {"scene.toml": b"a = 1\n"}) as log:
        for k in range(ticks):
            time = k * TICK
            aside = by * max(0, k - from_tick + 1)
            state = VehicleState(header(time, "world"), Pose(Point(aside, 0.0, 0.01 * k)), rotor_speed=(k, 2.0 * k))
            if k not in without:
                log.write("/drone1/ground_truth", VehicleState, state.encode(), time)
            if k % 5 == 0:
                log.write("/clock", Clock, Clock(stamp(time)).encode(), time)
            if k % 100 == 0:
                log.flush()
        log.write("/drone1/status", Status, Status(header(0, ""), mode="a;b").encode(), 0)
    return path


def test_info_prints_provenance_topics_and_gaps(lapwing, tmp_path):
    write(tmp_path / "a.mcap", without=range(100, 110))
    code, out, _ = lapwing("info", "a.mcap")
    lines = {line.split()[0]: " ".join(line.split()[1:]) for line in out.splitlines()}
    assert code == 0
    assert (lines["scene"], lines["seed"], lines["solver"]) == ("made_up", "7", "rk4, step 0.001 s")
    assert lines["duration"].startswith("1.996 s, from 0 to 1.996 s")
    assert lines["digest"] == LogReader(tmp_path / "a.mcap").digest()
    assert lines["/clock"] == "100 50 1.2 rosgraph_msgs/msg/Clock"
    assert lines["/drone1/ground_truth"].startswith("490 250 ")
    assert lines["/drone1/ground_truth"].endswith(" lapwing_msgs/msg/VehicleState 1, longest 0.044 s")
    assert "0.00 mode a;b" in " ".join(out.split())
    assert lines["resimulate"] == "not possible: the log lacks an attachment config.json"


def test_verify_recomputes_digest(lapwing, tmp_path):
    path = write(tmp_path / "a.mcap")
    code, out, _ = lapwing("verify", path)
    assert code == 0
    with LogReader(path) as log:
        assert log.metadata["digest"] in out
    other = path.read_bytes().replace(log.metadata["digest"].encode(), b"0" * 32)
    path.write_bytes(other)
    code, _, err = lapwing("verify", path)
    assert code == 3
    assert f"recorded {'0' * 32}" in err


def test_changed_log_ends_resimulation_as_it_ends_verify(tmp_path):
    path = fly("hover", {"run.duration": 0.1}).save(tmp_path / "a.mcap")
    with LogReader(path) as log, LogWriter(tmp_path / "b.mcap", log.metadata, log.attachments) as other:
        for topic, kind, time_ns, payload in list(log.messages())[:-1]:
            other.write(topic, kind, payload, time_ns)
    assert_rejected(run_command("resimulate", tmp_path / "b.mcap"), "digests differ", code=3)


def test_verify_explains_log_of_another_machine(tmp_path):
    """Run the command as a process on a log of another machine and on one of another commit."""
    recorded = {"python": "3.13.5", "packages": "numba 0.61.0", "system": "Linux glibc", "processor": "aarch64 A76"}
    path = write(tmp_path / "a.mcap", commit="0123456789ab", **recorded)

    def explain():
        return run_command("verify", path, "--explain", LAPWING_COMMIT="0123456789ab")

    result = explain()
    assert result.returncode == 0, result.stderr
    lines = {line.split()[0]: line.split(maxsplit=1)[1] for line in result.stdout.splitlines()}
    assert all(lines[name].startswith(f"{text} (here ") for name, text in recorded.items())
    assert lines["commit"] == "0123456789ab (same)"
    assert lines["expected"].startswith("equal: same commit of Lapwing; processor")
    path.write_bytes(path.read_bytes().replace(b"0123456789ab", b"ba9876543210"))
    result = explain()
    assert "commit     ba9876543210 (here 0123456789ab)" in result.stdout
    assert "expected   not certain: recorded by another commit of Lapwing; check out ba9876543210" in result.stdout


def test_verify_finds_first_difference_and_growth(lapwing, tmp_path):
    a, b = write(tmp_path / "a.mcap"), write(tmp_path / "b.mcap", from_tick=200, by=0.001, seed="8")
    code, out, err = lapwing("verify", a, b)
    assert (code, err.count("\n")) == (3, 1)
    assert out.splitlines()[0] == "seed: 7 | 8"
    assert out.splitlines()[1] == "first difference: /drone1/ground_truth at t = 0.8 s, pose.position.x: 0.0 | 0.001"
    rows = [list(map(float, line.split())) for line in out.splitlines()[3:]]
    assert [row[0] for row in rows] == pytest.approx([0.0, 0.012, 0.1, 1.0, 1.196])
    # drifts by 1 mm per tick of 4 ms
    assert [row[1] for row in rows] == pytest.approx([0.001 * (1 + row[0] / 0.004) for row in rows])
    assert [row[1] for row in rows] == [row[2] for row in rows]


def test_logs_of_equal_messages_are_equal_for_any_chunks(lapwing, tmp_path):
    path = write(tmp_path / "a.mcap")
    with LogReader(path) as log, LogWriter(tmp_path / "b.mcap", ABOUT, {}) as other:
        for topic, kind, time_ns, payload in log.messages():
            other.write(topic, kind, payload, time_ns)
    code, out, _ = lapwing("verify", path, "b.mcap")
    assert (code, out) == (0, f"{path} and b.mcap: identical messages\n")


def test_missing_message_is_difference(lapwing, tmp_path):
    write(tmp_path / "a.mcap"), write(tmp_path / "b.mcap", without=[300])
    code, out, _ = lapwing("verify", "a.mcap", "b.mcap")
    assert code == 3
    assert out == "first difference: /drone1/ground_truth at t = 1.2 s, messages: 1 messages | 0 messages\n"
    write(tmp_path / "c.mcap", ticks=400)
    code, out, _ = lapwing("verify", "a.mcap", "c.mcap")
    assert "/drone1/ground_truth at t = 1.6 s" in out


def test_recover_restores_flushed_messages(lapwing, tmp_path):
    code = textwrap.dedent(
        """
        import os, signal, time
        from lapwing.messages import Clock, stamp
        from lapwing.cosim.log import LogWriter
        log = LogWriter("killed.mcap", {"seed": "7"}, {"scene.toml": b"x"})
        for k in range(3000):
            log.write("/clock", Clock, Clock(stamp(k)).encode(), k)
            time.sleep(0.0005)
        print(flush=True)
        os.kill(os.getpid(), signal.SIGKILL)
        """
    )
    done = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == -signal.SIGKILL, done.stderr
    assert lapwing("verify", "killed.mcap")[0] == 2
    assert "no end" in " ".join(lapwing("info", "killed.mcap")[1].replace("none", "no end").split())
    code, out, _ = lapwing("recover", "killed.mcap")
    assert code == 0
    with open("killed_recovered.mcap", "rb") as file:
        times = [m.log_time for _, _, m in make_reader(file, validate_crcs=True).iter_messages()]
    assert times == list(range(len(times)))
    assert 3000 - len(times) <= 1000  # intervals of 0.5 ms or more: messages written in the last 0.5 s
    assert f"{len(times)} messages up to t = {times[-1] * 1e-9:g} s" in out
    assert lapwing("verify", "killed_recovered.mcap")[0] == 0


def test_damaged_chunk_is_left_out_and_named(lapwing, tmp_path):
    path = write(tmp_path / "a.mcap")
    data = bytearray(path.read_bytes())
    data[data.index(b"\x28\xb5\x2f\xfd", len(data) // 2) + 200] ^= 0xFF  # in a compressed chunk
    path.write_bytes(data)
    code, _, err = lapwing("verify", path)
    assert code == 2
    assert "damaged chunk at byte" in err
    code, out, _ = lapwing("recover", path, "--out", "b.mcap")
    assert code == 0
    assert out.startswith("left out: damaged chunk at byte")
    with LogReader("b.mcap") as log:
        times = [t // TICK for topic, _, t, _ in log.messages(["/drone1/ground_truth"])]
        assert log.complete
        assert log.metadata["recovered"].startswith("a.mcap: damaged chunk")
    assert 350 <= len(times) < 500
    assert times == sorted(times)


def test_export_of_cut_log_warns(lapwing, tmp_path):
    whole = write(tmp_path / "whole.mcap", ticks=10)
    assert lapwing("export", whole, "--csv", "csv")[::2] == (0, "")
    (tmp_path / "cut.mcap").write_bytes(whole.read_bytes()[:-100])
    code, out, err = lapwing("export", "cut.mcap", "--csv", "cut")
    assert (code, err) == (0, "cut.mcap: the log is incomplete: its end is missing, see lapwing info\n")
    assert "cut/clock.csv" in out


def test_export_writes_table_topic_with_units(lapwing, tmp_path):
    write(tmp_path / "a.mcap")
    code, out, _ = lapwing(
        "export", "a.mcap", "--csv", "csv", "--mat", "a.mat", "--topics", "/drone1/ground_truth,/drone1/status"
    )
    assert code == 0
    assert (
        out.splitlines() == ["csv/drone1.ground_truth.csv", "csv/drone1.status.csv", "a.mat"]
        or len(out.splitlines()) == 3
    )
    with open("csv/drone1.ground_truth.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 500
    assert float(rows[7]["time [s]"]) == 7 * 0.004
    assert float(rows[7]["pose.position.z [m]"]) == 0.01 * 7
    assert float(rows[7]["rotor_speed.1 [rad/s]"]) == 14.0
    result = loadmat("a.mat", simplify_cells=True)
    assert np.array_equal(result["drone1_ground_truth"]["rotor_speed_1"], 2.0 * np.arange(500))
    assert result["drone1_ground_truth"]["units"]["rotor_speed_1"] == "rad/s"
    assert result["drone1_status"]["mode"] == "a;b"
    with open("csv/drone1.status.csv", newline="") as file:
        assert next(csv.DictReader(file))["mode"] == "a;b"


def test_parquet_has_types_and_units(lapwing, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet", reason="needs the extra `parquet`")
    write(tmp_path / "a.mcap")
    assert lapwing("export", "a.mcap", "--parquet", "tables")[0] == 0
    table = parquet.read_table("tables/drone1.ground_truth.parquet")
    assert table.column("rotor_speed.1").to_pylist() == [2.0 * k for k in range(500)]
    assert table.schema.field("rotor_speed.1").metadata == {b"unit": b"rad/s"}
    assert table.schema.field("ground_contact").type == "bool"


@pytest.fixture
def foreign(tmp_path):
    """Write a log of another tool."""
    path = tmp_path / "foreign.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("a", "jsonschema", b"{}")
        channel = writer.register_channel("/a", "json", schema)
        for k in range(3):
            writer.add_message(channel, k, json.dumps(k).encode(), k)
        writer.finish()
    return path


def test_foreign_log_is_reported_with_missing_parts(lapwing, foreign):
    code, out, _ = lapwing("info", foreign)
    assert code == 0
    assert "report not possible: the log lacks a topic /NAME/ground_truth" in " ".join(out.split())
    assert "/a 3 " in " ".join(out.split())


OLD = "lapwing_msgs/msg/VehicleState has bool ground_contact where this version has float64 air_density"


@pytest.fixture
def old(tmp_path, monkeypatch):
    """Write a log of a version without the air density in the true state, whole and cut off before its end."""
    text = VehicleState.schema_text.replace("float64 air_density", "#")
    monkeypatch.setattr(VehicleState, "schema_text", text)
    whole = write(tmp_path / "old.mcap", ticks=300, version="0.0.9").read_bytes()
    monkeypatch.undo()
    monkeypatch.chdir(tmp_path)
    (tmp_path / "old_cut.mcap").write_bytes(whole[:-100])
    write(tmp_path / "new.mcap", ticks=300)
    return tmp_path / "old.mcap"


def test_log_of_other_version_reports_types_and_verifies_bytes(lapwing, old):
    code, out, err = lapwing("info", old)
    assert (code, err) == (0, "")
    assert f"report not possible: the log lacks messages of this version: {OLD}" in " ".join(out.split())
    assert "version 0.0.9" in " ".join(out.split())
    assert lapwing("verify", old)[0] == 0


@pytest.mark.parametrize(
    "arguments",
    [
        ["verify", "old.mcap", "new.mcap"],
        ["verify", "new.mcap", "old.mcap"],
        ["replay", "old.mcap"],
        ["view", "old.mcap"],
        ["report", "old.mcap"],
        ["recover", "old_cut.mcap"],
        ["export", "old.mcap", "--csv", "csv"],
    ],
)
def test_log_of_other_version_with_changed_types_is_rejected(lapwing, old, arguments):
    before = sorted(os.listdir())
    assert_rejected(
        lapwing(*arguments),
        f"/drone1/ground_truth: {OLD}; expected a log of this version, Lapwing ",
        ", got one of Lapwing 0.0.9",
    )
    assert sorted(os.listdir()) == before


def test_unchanged_types_of_other_version_are_replayed(lapwing, old):
    assert lapwing("export", old, "--csv", "csv", "--topics", "/clock")[0] == 0
    assert lapwing("replay", old, "--topics", "/clock", "--speed", "max")[0] == 0


@pytest.mark.parametrize(
    ("arguments", "output"),
    [
        (["info", "none.mcap"], "none.mcap: cannot be read: no such file or directory; expected a log"),
        (["info", "text.mcap"], "text.mcap: not an MCAP file; `lapwing import`"),
        (["verify", "whole.mcap", "whole.mcap"], "is the same file as FILE"),
        (["verify", "foreign.mcap"], "has no digest"),
        (["recover", "whole.mcap"], "no recovery is needed"),
        (["recover", "cut.mcap", "--out", "none/a.mcap"], "none/a.mcap: cannot be written"),
        (["export", "whole.mcap"], "expected --parquet FOLDER, --csv FOLDER, --mat FILE or --ulog FILE"),
        (["export", "whole.mcap", "--csv", "csv", "--topics", "/x"], "the log has no topic /x; it has /clock"),
        (["export", "foreign.mcap", "--csv", "csv"], "unknown message type a"),
        (["export", "whole.mcap", "--csv", "whole.mcap"], "is the same file as FILE"),
        (["export", "whole.mcap", "--csv", "text.mcap"], "text.mcap: is a file; expected the path of an output folder"),
    ],
)
def test_bad_input_is_one_line(lapwing, tmp_path, foreign, arguments, output):
    whole = write(tmp_path / "whole.mcap", ticks=10).read_bytes()
    (tmp_path / "cut.mcap").write_bytes(whole[:-100])
    (tmp_path / "text.mcap").write_text("no log")
    before = sorted(os.listdir())
    assert_rejected(lapwing(*arguments), output)
    assert sorted(os.listdir()) == before
