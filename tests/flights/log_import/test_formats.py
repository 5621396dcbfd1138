"""Import of flights in the format of each autopilot, from files of independent writers."""

from pathlib import Path

import flight_writers
import numpy as np
import pytest
from flight_recordings import BATTERY, real_flights
from flight_writers import (
    ALOFT,
    ARMED,
    GRAVITY,
    INTERVAL,
    SAMPLES,
    ULOG,
    WRITERS,
    dataflash_rows,
    write_bin,
    write_ulog,
)
from scipy.spatial.transform import Rotation

from lapwing.flights.flight_data import FlightData
from lapwing.flights.log_import import csv_flight
from lapwing.flights.log_import.dataflash_flight import read_dataflash_flight
from lapwing.flights.log_import.open_flight import open_flight
from lapwing.flights.rotation_arrays import conjugate, product, rotation_vector
from tests.commands import run_command


@pytest.mark.parametrize("name", WRITERS)
def test_format_returns_flight(tmp_path, flight, name):
    path = tmp_path / name
    WRITERS[name](path, flight)
    result = open_flight(path)
    n = len(result)
    assert n >= SAMPLES - 2
    assert result.valid.all()
    assert result.position == pytest.approx(flight.position[:n], abs=2e-3)
    error = rotation_vector(product(conjugate(flight.attitude[:n]), result.attitude))
    assert np.abs(error).max() < 1e-3
    assert result.velocity == pytest.approx(flight.velocity[:n], abs=2e-3)
    assert result.omega == pytest.approx(flight.omega[:n], abs=2e-3)
    assert result.specific_force == pytest.approx(flight.specific_force[:n], abs=2e-3)
    assert result.motor_voltage == pytest.approx(flight.motor_voltage[:n], abs=5e-3)
    assert result.battery_voltage == pytest.approx(np.full(n, BATTERY), abs=1e-3)
    assert any(note.startswith("gyroscope +0 ms against attitude, correlation 1.00") for note in result.notes)


def test_ulog_setpoints_equal_those_of_the_trajectory(tmp_path, flight):
    write_ulog(tmp_path / "f.ulg", flight)
    result = open_flight(tmp_path / "f.ulg")
    n = len(result)
    angles = Rotation.from_quat(flight.attitude[:n, [1, 2, 3, 0]]).as_euler("ZYX")[:, ::-1]
    assert result.setpoint[:, :3] == pytest.approx(flight.position[:n], abs=1e-5)
    assert result.setpoint[:, 3:6] == pytest.approx(flight.velocity[:n], abs=1e-5)
    assert result.setpoint[1:-1, 6:9] == pytest.approx(
        np.gradient(flight.velocity[:n], INTERVAL, axis=0)[1:-1], abs=1e-4
    )
    assert np.cos(result.setpoint[:, 9] - angles[:, 2]) == pytest.approx(np.ones(n), abs=1e-6)
    assert result.setpoint[:, 10] == pytest.approx(np.full(n, 0.8))
    assert result.attitude_setpoint[:, :2] == pytest.approx(angles[:, :2], abs=1e-5)
    assert result.readings["gps_velocity"].values[:n] == pytest.approx(flight.velocity[:n], abs=1e-5)
    assert result.readings["optical_flow"].values[0] == pytest.approx([1.0, -2.0, 3.0, -4.0, 2.0])
    assert result.unknown == ("vehicle_rates_setpoint",)


def test_setpoints_of_single_fields_are_read(tmp_path, flight, monkeypatch):
    single = {
        **ULOG,
        "trajectory_setpoint": "float x;float y;float z;float vx;float vy;float vz;float acc_x;float acc_y;float acc_z;"
        "float yaw;float yawspeed;",
    }
    write_ulog(tmp_path / "new.ulg", flight)
    monkeypatch.setattr(flight_writers, "ULOG", single)
    write_ulog(tmp_path / "old.ulg", flight)
    new, old = (open_flight(tmp_path / name).setpoint for name in ("new.ulg", "old.ulg"))
    assert np.array_equal(new, old)


@pytest.mark.long
def test_imported_setpoints_are_in_the_log(tmp_path, flight):
    write_ulog(tmp_path / "f.ulg", flight)
    done = run_command("import", tmp_path / "f.ulg", "--out", tmp_path / "f.mcap", code=0)
    assert "topics without a counterpart: vehicle_rates_setpoint\n" in done.stdout
    log = FlightData.read(tmp_path / "f.mcap")
    n = len(log.setpoint)
    assert log.setpoint.position == pytest.approx(flight.position[:n], abs=1e-5)
    assert np.cos(log.setpoint.yaw - log.truth.attitude[:, 2]) == pytest.approx(np.ones(n), abs=1e-6)
    assert max(log.rmse.values()) < 1e-5
    assert len(log.topic("gps/velocity")) >= n
    assert log.topic("optical_flow").flow[0] == pytest.approx([1.0, -2.0])
    status, at = log.status, np.arange(n)
    assert set(status.mode) == {"mission"}
    assert np.array_equal(status.armed[:n], at >= ARMED)
    assert np.array_equal(status.landed[:n], at < ALOFT)
    again = open_flight(tmp_path / "f.mcap")
    assert again.setpoint[1:, :3] == pytest.approx(flight.position[1 : len(again)], abs=1e-5)


def test_unknown_topics_are_listed(tmp_path, flight):
    write_bin(tmp_path / "f.bin", flight)
    assert open_flight(tmp_path / "f.bin").unknown == ("MSG",)


def test_betaflight_columns_become_si_quantities(tmp_path, flight):
    duty = 48.0 + 1999.0 * flight.motor_voltage / BATTERY
    columns = {
        "loopIteration": np.arange(SAMPLES), " time (us)": 1e4 * np.arange(SAMPLES),
        **{f" gyroADC[{k}]": np.degrees(flight.omega[:, k]) for k in range(3)},
        **{f" accSmooth[{k}]": 2048.0 * flight.specific_force[:, k] / GRAVITY for k in range(3)},
        **{f" motor[{k}]": duty[:, k] for k in range(4)},
        " vbatLatest (V)": flight.battery_voltage,
    }  # fmt: skip
    table = np.column_stack(list(columns.values()))
    path = tmp_path / "blackbox.csv"
    np.savetxt(path, table, "%.6f", ",", header=",".join(columns), comments="")
    result = open_flight(path, "betaflight")
    assert result.omega == pytest.approx(flight.omega, abs=1e-6)
    assert result.specific_force == pytest.approx(flight.specific_force, abs=1e-6)
    assert result.motor_voltage == pytest.approx(flight.motor_voltage, abs=1e-6)
    assert np.isnan(result.position).all()
    assert any("no position" in note for note in result.notes)


@pytest.mark.long
@pytest.mark.parametrize("name", ["f.bin", "f.tlog", "log07", "bag"])
def test_command_imports_format(tmp_path, flight, name):
    WRITERS[name](tmp_path / name, flight)
    run_command("import", tmp_path / name, "--out", tmp_path / "out.mcap", code=0)
    again = open_flight(tmp_path / "out.mcap")
    assert again.position == pytest.approx(flight.position[: len(again)], abs=2e-3)


@pytest.mark.parametrize("content", [b"", b"\xbc\x02\x00\xff", b"\xa3\x95\x80" + bytes(86), bytes(range(256)) * 20])
@pytest.mark.parametrize("name", ["f.bin", "f.log", "f.tlog", "log07"])
def test_damaged_file_is_rejected_in_one_line(tmp_path, name, content):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(ValueError, match=name) as raised:
        open_flight(path)
    assert "\n" not in str(raised.value)


def test_telemetry_log_may_end_within_a_message(tmp_path, flight):
    WRITERS["f.tlog"](tmp_path / "f.tlog", flight)
    whole = (tmp_path / "f.tlog").read_bytes()
    vibration = b"\xfd\x20\x00\x00\x00\x01\x01\xf1\x00\x00"  # header of an unknown message
    (tmp_path / "f.tlog").write_bytes(whole + whole[:8] + vibration + bytes(8))
    assert len(open_flight(tmp_path / "f.tlog")) >= SAMPLES - 2


def test_log_without_motor_outputs_is_rejected(tmp_path, flight, monkeypatch):
    rows = [row for row in dataflash_rows(flight) if row[0] != "RCOU"]
    monkeypatch.setattr(flight_writers, "dataflash_rows", lambda flight: iter(rows))
    write_bin(tmp_path / "f.bin", flight)
    with pytest.raises(ValueError, match="no motor outputs"):
        open_flight(tmp_path / "f.bin")


def test_ulog_of_real_vehicle_keeps_its_sensors():
    result = open_flight(Path(real_flights("ulog")) / "sample_log_small.ulg")
    assert {"gps", "baro", "mag", "airspeed"} <= set(result.readings)
    assert result.readings["gps"].values[0] == pytest.approx([63.417, 10.408, 106.77], abs=0.2)  # above ellipsoid
    assert 25e-6 < np.linalg.norm(result.readings["mag"].values, axis=1).mean() < 65e-6


def test_crazyflie_log_of_real_vehicle_is_in_si_units(tmp_path):
    (tmp_path / "log10").write_bytes((real_flights("arpl_crazyflie") / "log10").read_bytes())
    result = open_flight(tmp_path / "log10")
    assert np.median(result.specific_force[:, 2]) == pytest.approx(GRAVITY, rel=0.03)
    assert 1.0 / result.interval == pytest.approx(1010, rel=1e-12)  # the most frequent step is that of 1011 Hz


@pytest.mark.parametrize(("step", "rate"), [(0.01, 100), (0.00999, 100), (0.00099, 1010), (0.000125, 8000), (5.0, 1)])
def test_second_has_whole_number_of_rows(step, rate):
    assert csv_flight._interval(step * np.arange(50)) == pytest.approx(1.0 / rate, rel=1e-12)


@pytest.mark.parametrize("rate", [400, 1010, 300])
def test_interval_is_mean_of_coarse_clock_without_gaps(rate):
    time = np.arange(2000) / rate
    coarse = np.floor(1e4 * time) * 1e-4 + np.where(np.arange(2000) < 900, 0.0, 0.7)
    assert csv_flight._interval(np.delete(coarse, slice(50, 2000, 100))) == pytest.approx(1.0 / rate, rel=1e-12)


@pytest.mark.parametrize("content", [b"", b"\xa3\x95\x80" + bytes(20)], ids=["empty", "cut"])
def test_unreadable_dataflash_log_is_closed(tmp_path, content):
    path = tmp_path / "flight.bin"
    path.write_bytes(content)
    with pytest.raises(ValueError, match="dataflash"):
        read_dataflash_flight(path)
    assert path not in [link.resolve() for link in Path("/proc/self/fd").iterdir()]
