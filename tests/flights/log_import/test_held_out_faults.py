"""Further faults of logs than those after which the checks were made, through the command `lapwing import`."""

from dataclasses import replace

import numpy as np
import pytest
from flight_recordings import BATTERY, write_csv
from flight_writers import SAMPLES, ULOG, ned, write_ulog_topics
from typer.testing import CliRunner

from lapwing.cli.main import app
from lapwing.flights.log_import.open_flight import open_flight
from lapwing.flights.log_import.recording import Series
from tests.flights.log_import.test_bag_frames import bag
from tests.flights.log_import.test_log_doubts import (
    GPS_FIELDS,
    JUMP,
    RANGE_FIELDS,
    local,
)


def imported(path, *options):
    """Return the output of `lapwing import`, and the flight in the log that it writes."""
    out = path.parent / "imported.mcap"
    done = CliRunner().invoke(app, ["import", str(path), "--out", str(out), *options])
    assert done.exit_code == 0, done.output
    return done.output, open_flight(out)


def check(result, flight, full=1.0):
    """Check that a flight is complete; `full`: voltage that the log does not have."""
    n = len(result)
    assert n >= SAMPLES - 2
    assert result.valid.all()
    assert result.position == pytest.approx(flight.position[:n], abs=2e-3)
    assert np.abs((result.attitude * flight.attitude[:n]).sum(axis=1)) == pytest.approx(np.ones(n), abs=1e-5)
    assert result.velocity == pytest.approx(flight.velocity[:n], abs=5e-3)
    assert result.omega == pytest.approx(flight.omega[:n], abs=2e-3)
    assert full * result.motor_voltage == pytest.approx(flight.motor_voltage[:n], abs=1e-2)


def attitude(quaternion_of):
    return ("vehicle_attitude", 0, ULOG["vehicle_attitude"], "4f", quaternion_of)


def test_signs_of_quaternions_may_flip(tmp_path, flight):
    q = ned(flight)["quaternion"]
    path = write_ulog_topics(tmp_path / "f.ulg", flight, [attitude(lambda k: q[k] * (-1.0) ** (k // 7))])
    check(imported(path)[1], flight)


def test_quaternions_of_zeros_are_left_out(tmp_path, flight):
    q = ned(flight)["quaternion"]
    path = write_ulog_topics(tmp_path / "f.ulg", flight, [attitude(lambda k: q[k] * (k >= 50))])
    output, result = imported(path)
    assert "marked samples: no unit quaternion: 50" in output
    assert np.isfinite(result.attitude).all()
    assert len(result) == pytest.approx(SAMPLES - 52, abs=2)


def test_dropout_of_a_single_topic_is_left_out(tmp_path, flight):
    q = ned(flight)["quaternion"]
    lost = attitude(lambda k: None if 150 <= k < 190 else q[k])
    output, result = imported(write_ulog_topics(tmp_path / "f.ulg", flight, [lost]))
    assert not result.valid[151:189].any()
    assert result.valid[:148].all()
    assert result.valid[192:].all()
    assert "marked samples: gap in a topic: 4" in output


@pytest.mark.parametrize("row", [(47.4, 8.5, 441.0, 488.3, 2), (0.0, 0.0, -17.0, -17.0, 3)], ids=["2D", "0 N 0 E"])
def test_receiver_without_fix_in_three_dimensions(tmp_path, flight, row):
    output, result = imported(
        write_ulog_topics(tmp_path / "f.ulg", flight, [("sensor_gps", 0, GPS_FIELDS, "4dB", lambda k: row)])
    )
    assert "gps: no sample of sensor_gps is to be believed; no fix: 400" in output
    assert "gps" not in result.readings


def test_downward_range_sensor_with_most_valid_readings(tmp_path, flight):
    rows = ((0, 0, 100, 12.5), (1, 25, 100, 7.0), (2, 25, 20, 2.0))
    topics = [
        ("distance_sensor", n, RANGE_FIELDS, "3fBb",
         lambda k, d=d, facing=facing, q=q: (d, 0.1, 30.0, facing, q if q < 50 or k % 4 == 0 else 0))
        for n, facing, q, d in rows
    ]  # fmt: skip
    output, _ = imported(write_ulog_topics(tmp_path / "f.ulg", flight, topics))
    assert "rangefinder: instance 2 of distance_sensor (0, 1, 2)" in output


def test_idle_instances_with_offsets_are_not_taken(tmp_path, flight):
    duty, outputs, power = ned(flight)["duty"], "uint32_t noutputs;float[4] output;", ULOG["battery_status"]
    topics = [
        ("actuator_motors", 0, "float[4] control;", "4f", lambda k: None),
        ("actuator_outputs", 0, outputs, "I4f", lambda k: (4, *(4 * [900.0 if k < 100 else 1000.0]))),
        ("actuator_outputs", 1, outputs, "I4f", lambda k: (4, *(1000.0 + 1000.0 * duty[k]))),
        ("battery_status", 0, power, "2f", lambda k: (0.21, 0.0)),
        ("battery_status", 1, power, "2f", lambda k: (4.3, 2.0)),
    ]
    output, result = imported(write_ulog_topics(tmp_path / "f.ulg", flight, topics))
    check(result, flight)
    assert "duty: instance 1 of actuator_outputs (0, 1); 0 without data" in output


@pytest.mark.parametrize("valid", [(1, 1, 1, 1, 0), (0, 1, 1, 1, 0)], ids=["position", "velocity only"])
def test_velocity_without_position_is_kept(tmp_path, flight, valid):
    path = write_ulog_topics(tmp_path / "f.ulg", flight, [local(flight, lambda k: valid)])
    _, result = imported(path)
    assert result.velocity == pytest.approx(flight.velocity[: len(result)], abs=2e-3)
    assert result.missing == ([] if valid[0] else ["position"])


def test_two_lane_switches_are_two_events(dataflash):
    def change(name, values):
        sample = (values[0] - 5_000_000) // 10_000
        if name == "XKF1":
            yield "XKF4", (values[0], 0, int(100 <= sample < 300))
        yield name, values
        if name in ("XKF1", "XKQ"):
            yield name, (values[0], 1, *values[2:])

    output, result = dataflash(change, {"XKF4": (72, "QBb", "TimeUS,C,PI")}, imported)
    assert "marked samples: EKF lane switch: 6" in output
    wrong = np.flatnonzero(~result.valid)
    assert {99, 100, 299, 300} <= set(wrong) <= {*range(97, 103), *range(297, 303)}


def test_solution_that_is_lost_twice_is_left_out(dataflash):
    def change(name, values):
        sample = (values[0] - 5_000_000) // 10_000
        if name == "XKF1":
            yield "XKF4", (values[0], 0, 0, 0 if sample % 200 in range(50, 100) else 0b11111111)
        yield name, values

    output, result = dataflash(change, {"XKF4": (72, "QBbH", "TimeUS,C,PI,SS")}, imported)
    assert "marked samples: position not valid: 100" in output
    assert not result.valid[[60, 90, 260, 290]].any()
    assert result.valid[[20, 150, 220, 350]].all()


@pytest.mark.parametrize("boot", [True, False], ids=["clock", "no clock"])
def test_clock_of_ground_station_is_set_back_twice(tlog, flight, boot):
    def change(k, message):
        for field in () if boot else ("time_boot_ms", "time_usec"):  # 0 of a sender without a clock
            if hasattr(message, field):
                setattr(message, field, 0)
        yield message

    _, result = tlog(change, lambda k: -3600.0 * (k >= 100) - 7200.0 * (k >= 250), imported)
    assert len(result) >= SAMPLES - 4  # two steps between samples are lost with the clock
    assert result.motor_voltage[:95] == pytest.approx(flight.motor_voltage[:95], abs=5e-3)
    assert result.position[-5:] == pytest.approx(flight.position[len(result) - 5 : len(result)], abs=0.1)


def test_gyroscope_of_camera_in_frame_of_vehicle_is_rejected(tmp_path, flight):
    output, result = imported(bag(tmp_path / "bag", flight, cameras=[(2, "base_link")]))
    check(result, flight, BATTERY)
    assert "/base_link/imu turns differently" in output


def test_swapped_frames_of_odometry_are_refused_or_named(tmp_path, flight):
    path = bag(tmp_path / "bag", flight, child="map")  # the twist is in body axes in fact
    refused = CliRunner().invoke(app, ["import", str(path), "--out", str(tmp_path / "f.mcap")])
    assert refused.exit_code == 2
    assert "use --twist-frame body" in refused.output
    check(imported(path, "--twist-frame", "body")[1], flight, BATTERY)


def test_axes_of_bag_follow_names_of_frames(tmp_path, flight):
    v = ned(flight)
    turned = replace(flight, position=v["position"], velocity=v["velocity"], attitude=v["quaternion"],
                     omega=v["omega"], specific_force=v["force"])  # fmt: skip
    path = bag(tmp_path / "bag", turned, child="base_link_frd", world="odom_ned", body="base_link_frd")
    check(imported(path)[1], flight, BATTERY)


def test_topics_with_stamps_of_two_clocks(tmp_path, flight):
    output, result = imported(bag(tmp_path / "bag", flight, boot=1_699_990_000))
    check(result, flight, BATTERY)
    assert "times of reception are used" in output


def altered(tmp_path, flight, change):
    """Return a CSV file of a flight whose bytes are changed by a function of its lines."""
    path = write_csv(tmp_path / "f.csv", flight)
    path.write_bytes(change(path.read_text().splitlines()))
    return path


FORMS = {
    "utf16": lambda lines: "\r\n".join(line.replace(",", "\t").replace(".", ",") for line in lines).encode("utf-16"),
    "header again": lambda lines: "\n".join([*lines[:150], lines[0], *lines[150:]]).encode(),
    "latin": lambda lines: "\n".join([f"{lines[0]},heading_\xb0", *(f"{line},1" for line in lines[1:])]).encode(
        "latin1"
    ),
    "blank": lambda lines: "\n\n".join(lines).encode(),
    "old mac": lambda lines: "\r".join(lines).encode(),
}


@pytest.mark.parametrize("form", FORMS)
def test_form_of_csv_file(tmp_path, flight, form):
    path = altered(tmp_path, flight, FORMS[form])
    _, result = imported(path, "--mapping", "nanobench")
    assert result.position == pytest.approx(flight.position[: len(result)], abs=1e-6)


def test_column_that_occurs_twice_is_named(tmp_path, flight):
    path = altered(tmp_path, flight, lambda lines: "\n".join(f"{line},{line.split(',')[1]}" for line in lines).encode())
    done = CliRunner().invoke(app, ["import", str(path), "--out", str(tmp_path / "f.mcap"), "--mapping", "nanobench"])
    assert (done.exit_code, done.output.count("\n")) == (2, 1)
    assert "column px occurs twice; rename or delete one" in done.output


def test_table_has_80_columns(tmp_path, flight):
    flags = local(flight, lambda k: (not 100 <= k < 250, 1, 1, 1, k >= JUMP))
    topics = [
        flags,
        *(("battery_status", n, ULOG["battery_status"], "2f", lambda k, n=n: (4.3 * n, 1.0)) for n in (0, 1)),
    ]
    output, _ = imported(write_ulog_topics(tmp_path / "f.ulg", flight, topics))
    table = output[output.index(" signal ") :].splitlines()
    assert max(map(len, table)) <= 80
    assert any("battery_status 1" in line for line in table)
    assert any("xy_valid 0 150" in line for line in table)


def test_fast_commands_are_means_of_held_values():
    commands = Series(0.002 * np.arange(500), np.arange(500.0)[:, None])
    assert commands.means(np.array([0.1, 0.503]), 0.01)[:, 0] == pytest.approx([52.0, 253.5])
