import gzip
import shutil
from dataclasses import replace

import numpy as np
import pytest
from flight_recordings import INTERVAL, real_flights, simulated, write_csv

from lapwing.cosim.log import LogWriter
from lapwing.flights.log_import.open_flight import open_flight
from lapwing.flights.log_import.recording import Recording
from lapwing.flights.log_import.ulog_flight import read_ulog_flight
from lapwing.flights.log_import.write_log import write_log
from lapwing.studies.validation.plant_rows import PlantRows
from tests.combinations import rest_nightly
from tests.commands import assert_rejected, run_command
from tests.fuzz.flights import dataflash


@pytest.fixture(scope="module")
def flight() -> Recording:
    return simulated(PlantRows("crazyflie_21", INTERVAL), 3.0, [1])[0]


@pytest.mark.long
def test_imported_log_reads_back_as_same_recording(flight, tmp_path):
    write_log(tmp_path / "flight.mcap", flight, "flight.csv")
    result = open_flight(tmp_path / "flight.mcap")
    n = len(result)
    assert n >= len(flight) - 1
    assert result.position == pytest.approx(flight.position[:n], abs=1e-9)
    assert result.attitude == pytest.approx(flight.attitude[:n], abs=1e-9)
    assert result.omega == pytest.approx(flight.omega[:n], abs=1e-9)
    assert result.motor_voltage == pytest.approx(flight.motor_voltage[:n], abs=1e-9)


@pytest.mark.long
def test_command_writes_log_that_other_commands_read(flight, tmp_path):
    source, out = write_csv(tmp_path / "flight.csv", flight), tmp_path / "flight.mcap"
    done = run_command("import", source, "--mapping", "nanobench", "--out", out, code=0)
    assert "against attitude" in done.stdout
    reported = run_command("info", out, code=0)
    assert "/drone1/ground_truth" in reported.stdout
    run_command("report", out, "--out", tmp_path / "flight.html", code=0)


@pytest.mark.long
def test_import_without_room_leaves_former_log(flight, tmp_path):
    source = write_csv(tmp_path / "flight.csv", flight)
    (tmp_path / "out").mkdir()
    out = tmp_path / "out" / "flight.mcap"
    out.write_text("former log")
    small = ["sh", "-c", 'ulimit -f 2; exec "$@"', "sh"]
    done = run_command("import", source, "--mapping", "nanobench", "--out", out, within=small)
    assert_rejected(done, f"lapwing: {out}: cannot write the log: File too large\n")
    assert {file.name: file.read_text() for file in out.parent.iterdir()} == {"flight.mcap": "former log"}


def broken(path, text):
    path.write_bytes(text)
    return path


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "content", "message"),
    rest_nightly(
        ("flight.ulg", b"no log", "is not a readable ULog file"),
        ("flight.csv", b"a,b\n1,2\n", "none of the mapped columns"),
        ("flight.csv.gz", b"no gzip", "cannot be read: not a gzipped file (b'no'); expected a table (.csv, .csv.gz)"),
        ("flight.csv.gz", gzip.compress(bytes(17_000_000)), "unpacks to over 16 MB"),
        ("flight.txt", b"1 2 3", "unknown format"),
        ("flight.mcap", b"\x89MCAP0\r\n", "is not a readable rosbag2"),
        keep=3,
    ),
)
def test_command_rejects_unreadable_files(tmp_path, name, content, message):
    path, out = broken(tmp_path / name, content), tmp_path / "out.mcap"
    assert_rejected(run_command("import", path, "--mapping", "nanobench", "--out", out), message)
    assert not out.exists()


def test_ulog_of_real_vehicle_has_consistent_axes(tmp_path):
    shutil.copy(real_flights("ulog") / "sample.ulg", tmp_path)
    result = read_ulog_flight(tmp_path / "sample.ulg")
    assert "cpuload" in result.unknown
    assert "correlation 1.00" in result.notes[-1] or "correlation 0.9" in result.notes[-1]
    assert np.median(result.specific_force[:, 2]) == pytest.approx(9.8, abs=0.5)


@pytest.mark.long
@pytest.mark.parametrize(
    ("height", "share", "reason"), [(0.05, 1.0, "height changes by"), (2.0, 0.0, "motors do not run")]
)
def test_flight_on_the_ground_is_reported_in_one_line(flight, tmp_path, height, share, reason):
    grounded = replace(
        flight, position=np.full_like(flight.position, height), motor_voltage=share * flight.motor_voltage
    )
    source, out = write_csv(tmp_path / "flight.csv", grounded), tmp_path / "flight.mcap"
    done = run_command("import", source, "--mapping", "nanobench", "--out", out, code=0)
    lines = [line for line in done.stdout.splitlines() if line.startswith("never leaves the ground")]
    assert len(lines) == 1
    assert reason in lines[0]
    assert_rejected(run_command("validate", "crazyflie_21", out), "leave the ground")


def test_setpoint_of_csv_is_in_the_log(flight, tmp_path):
    desired = flight.position + 0.1
    source = write_csv(tmp_path / "flight.csv", flight)
    lines = source.read_text().splitlines()
    lines[0] += ",sp_ctrltarget_x,sp_ctrltarget_y,sp_ctrltarget_z"
    lines[1:] = [f"{line},{','.join(map(str, p))}" for line, p in zip(lines[1:], desired.tolist(), strict=True)]
    source.write_text("\n".join(lines) + "\n")
    recording = open_flight(source, "nanobench")
    write_log(tmp_path / "flight.mcap", recording, source.name)
    result = open_flight(tmp_path / "flight.mcap")
    assert result.setpoint[1:, :3] == pytest.approx(desired[1 : len(result)], abs=1e-9)
    assert np.isnan(result.setpoint[:, 3:]).all()


def test_damaged_dataflash_log_is_imported_without_lines_of_its_parser(tmp_path):
    log = bytearray(dataflash().seeds[0])
    log[700:760] = b"9" * 60
    (tmp_path / "a.bin").write_bytes(log)
    result = run_command("import", tmp_path / "a.bin", "--out", tmp_path / "a.mcap")
    assert (result.returncode, result.stderr) == (0, "")
    assert "bad header" not in result.stdout


def test_failed_import_keeps_former_log(tmp_path, flight, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    out = tmp_path / "out.mcap"
    out.write_bytes(b"former")
    monkeypatch.setattr(LogWriter, "flush", interrupted)  # as the last messages are written
    with pytest.raises(KeyboardInterrupt):
        write_log(out, flight, "f.bin")
    assert [path.name for path in tmp_path.iterdir()] == ["out.mcap"]
    assert out.read_bytes() == b"former"


@pytest.mark.long
def test_log_of_imported_flight_repeats_it_and_keeps_its_gaps(flight, tmp_path):
    broken_flight = replace(flight, omega=flight.omega.copy())
    broken_flight.omega[150] = 60.0  # [rad/s] above the range of a gyroscope
    source, out = write_csv(tmp_path / "flight.csv", broken_flight), tmp_path / "imported.mcap"
    done = run_command("import", source, "--mapping", "nanobench", "--out", out, code=0)
    original, imported = open_flight(source, "nanobench"), open_flight(out)
    assert 0 < (~original.valid).sum() < 10
    assert (imported.valid == original.valid).all()
    assert imported.repeats(original)
    assert original.repeats(imported)
    done = run_command("validate", "crazyflie_21", out, source, "--mapping", "nanobench", code=0)
    assert "flight: the same flight as imported" in done.stdout
    assert "lacks a scene, it is a recorded flight" in run_command("info", out).stdout


@pytest.mark.long
@pytest.mark.parametrize("command", ["import", "validate", "identify"])
def test_mapping_that_no_file_uses_is_rejected(flight, tmp_path, command):
    log = tmp_path / "flight.bin"
    log.write_bytes(dataflash().seeds[0])
    arguments = {
        "import": (log, "--out", tmp_path / "out.mcap"),
        "validate": ("crazyflie_21", log),
        "identify": ("crazyflie_21", log, "--out", tmp_path / "out.toml", "--free", "airframe.mass.total"),
    }
    assert_rejected(
        run_command(command, *arguments[command], "--mapping", "nanobench"), f"--mapping nanobench: {log} needs none"
    )
    assert [path.name for path in tmp_path.iterdir()] == ["flight.bin"]


@pytest.mark.long
def test_sensor_fit_checks_output_first(flight, tmp_path):
    assert_rejected(
        run_command("identify", "crazyflie_21", tmp_path, "--sensors", "--out", tmp_path / "none" / "a.toml"),
        "there is no folder",
    )
