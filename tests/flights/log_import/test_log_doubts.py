"""Fields with which a log says not to believe a value: validity, resets, dropouts, fixes, datums and instances."""

from dataclasses import replace

import flight_writers
import numpy as np
import pytest
from flight_recordings import BATTERY
from flight_writers import (
    INTERVAL,
    SAMPLES,
    ULOG,
    ned,
    write_ulog_topics,
)
from pymavlink.dialects.v20 import common as mavlink

from lapwing.flights.flight_data import FlightData
from lapwing.flights.log_import.open_flight import open_flight
from lapwing.flights.log_import.source_choice import choices_of
from lapwing.flights.log_import.write_log import write_log
from tests.commands import assert_rejected, run_command

JUMP = 200  # first sample after a reset
FLAGS = "uint8_t xy_valid;uint8_t z_valid;uint8_t v_xy_valid;uint8_t v_z_valid;uint8_t xy_reset_counter;"
LOCAL = "vehicle_local_position"


def local(flight, flags, shift=None):
    """Return the topic with the estimate of the position, flags of each sample, and a shift from `JUMP` on."""
    v = ned(flight)
    moved = np.zeros(3) if shift is None else np.asarray(shift)
    return (
        LOCAL, 0, f"{ULOG[LOCAL]}{FLAGS}", "6f5B",
        lambda k: [*(v["position"][k] + moved * (k >= JUMP)), *v["velocity"][k], *flags(k)],
    )  # fmt: skip


def left_out(result, samples=2):
    """Check that a flight is invalid around `JUMP`, and nowhere else."""
    wrong = np.flatnonzero(~result.valid)
    assert {JUMP - 1, JUMP} <= set(wrong)
    assert wrong.min() >= JUMP - 1 - samples
    assert wrong.max() <= JUMP + samples


def row(result, signal):
    return next(r for r in result.sources if r.signal == signal)


@pytest.mark.parametrize("counter", [0, 255], ids=["counts", "wraps"])
def test_position_reset_of_ulog_is_left_out(tmp_path, flight, counter):
    small = (0.02, -0.01, 0.0)  # [m], no visible jump
    flags = local(flight, lambda k: (1, 1, 1, 1, (counter + (k >= JUMP)) % 256), small)
    result = open_flight(write_ulog_topics(tmp_path / "f.ulg", flight, [flags]))
    left_out(result)
    assert result.faults == {"xy reset": 1}
    assert row(result, "position").left_out == "xy reset 1"


@pytest.mark.parametrize("name", ["f.ulg", "f.bin", "f.tlog", "log07", "bag"])
def test_position_jump_without_counter_is_left_out(tmp_path, flight, name):
    moved = replace(flight, position=flight.position + np.outer(np.arange(SAMPLES) >= JUMP, (3.0, -2.0, 0.0)))
    flight_writers.WRITERS[name](tmp_path / name, moved)
    result = open_flight(tmp_path / name)
    left_out(result)
    assert result.faults == {"position jump": 1}


@pytest.mark.parametrize("name", ["f.ulg", "f.bin", "f.tlog", "log07", "bag"])
def test_yaw_jump_without_counter_is_left_out(tmp_path, flight, name):
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_quat(flight.attitude[:, [1, 2, 3, 0]])
    angle = np.radians(40.0) * (np.arange(SAMPLES) >= JUMP)
    attitude = (Rotation.from_rotvec(np.outer(angle, [0, 0, 1])) * turn).as_quat()[:, [3, 0, 1, 2]]
    flight_writers.WRITERS[name](tmp_path / name, replace(flight, attitude=attitude))
    result = open_flight(tmp_path / name)
    left_out(result)
    assert result.faults == {"attitude jump": 1}


def test_invalid_estimates_are_left_out(tmp_path, flight):
    flags = local(flight, lambda k: (not 100 <= k < 250, 1, 1, 1, 0))
    result = open_flight(write_ulog_topics(tmp_path / "f.ulg", flight, [flags]))
    assert not result.valid[100:250].any()
    assert result.valid[:97].all()
    assert result.valid[253:].all()
    assert result.faults == {"xy_valid 0": 150}
    flags = local(flight, lambda k: (0, 1, 0, 1, 0))
    result = open_flight(write_ulog_topics(tmp_path / "f.ulg", flight, [flags]))
    assert result.valid.all()
    assert np.isnan(result.position).all()
    assert any("no sample of vehicle_local_position" in note for note in result.notes)


def test_gap_of_all_topics_is_left_out(tmp_path, flight):
    result = open_flight(write_ulog_topics(tmp_path / "f.ulg", flight, lost=range(150, 190)))
    assert not result.valid[150:190].any()
    assert result.valid[:149].all()
    assert result.valid[191:].all()


def test_marked_dropout_is_left_out(tmp_path, flight):
    result = open_flight(write_ulog_topics(tmp_path / "f.ulg", flight, marks=[(100, 500)]))
    assert not result.valid[101:150].any()
    assert result.valid[:98].all()
    assert result.valid[153:].all()


GPS_FIELDS = (
    "double latitude_deg;double longitude_deg;double altitude_msl_m;double altitude_ellipsoid_m;uint8_t fix_type;"
)


def test_fix_and_datum_of_ulog(tmp_path, flight):
    def fix(k):
        return (47.4, 8.5, 441.0, 488.3, 3) if k >= 100 else (0.0, 0.0, 0.0, -17.0, 0)

    result = open_flight(write_ulog_topics(tmp_path / "f.ulg", flight, [("sensor_gps", 0, GPS_FIELDS, "4dB", fix)]))
    gps = result.readings["gps"]
    assert gps.time[0] == pytest.approx(1.0)
    assert gps.values == pytest.approx(np.tile([47.4, 8.5, 488.3], (SAMPLES - 100, 1)))
    assert (row(result, "gps").datum, row(result, "gps").left_out) == ("ellipsoid", "no fix 100")


def test_height_of_dataflash_is_above_ellipsoid_or_marked(tmp_path, dataflash):
    def change(name, values):
        yield name, values
        if name == "GPS":
            yield "GPA", (values[0], 0, -47.3)

    result = dataflash(change, {"GPA": (73, "QBf", "TimeUS,I,Und")})
    assert result.readings["gps"].values[:, 2] == pytest.approx(488.0 + 47.3, abs=1e-4)
    marked = dataflash(lambda name, values: [(name, values)])
    assert row(marked, "gps").datum == "mean sea level"
    write_log(tmp_path / "f.mcap", marked, "f.bin")
    log = FlightData.read(tmp_path / "f.mcap").topic("gps/fix")
    assert log.position_covariance[0] == pytest.approx([25.0, 0, 0, 0, 25.0, 0, 0, 0, 107.0**2])
    assert log.position_covariance_type[0] == 1


RANGE_FIELDS = "float current_distance;float min_distance;float max_distance;uint8_t orientation;int8_t signal_quality;"


def test_downward_range_sensor_is_taken(tmp_path, flight):
    topics = [
        ("distance_sensor", 0, RANGE_FIELDS, "3fBb", lambda k: (12.5, 0.1, 30.0, 0, 100)),
        ("distance_sensor", 1, RANGE_FIELDS, "3fBb", lambda k: (2.0, 0.1, 30.0, 25, 0 if k < 50 else 100)),
    ]
    result = open_flight(write_ulog_topics(tmp_path / "f.ulg", flight, topics))
    assert np.unique(result.readings["rangefinder"].values) == pytest.approx([2.0])
    assert row(result, "rangefinder")[2:] == ("1", "", "down", SAMPLES, "signal quality 0 50")
    result = open_flight(write_ulog_topics(tmp_path / "f.ulg", flight, topics[:1]))
    assert "rangefinder" not in result.readings


def test_downward_range_sensor_of_dataflash_is_taken(dataflash):
    def change(name, values):
        yield name, values
        if name == "BAT":
            yield "RFND", (values[0], 0, 12.5, 4, 0)
            yield "RFND", (values[0], 1, 2.0, 4, 25)

    result = dataflash(change, {"RFND": (74, "QBfBB", "TimeUS,Instance,Dist,Stat,Orient")})
    assert np.unique(result.readings["rangefinder"].values) == pytest.approx([2.0])


def test_instance_with_data_is_taken_and_can_be_overridden(tmp_path, flight):
    v = ned(flight)
    outputs, power = "uint32_t noutputs;float[4] output;", ULOG["battery_status"]
    topics = [
        ("actuator_motors", 0, "float[4] control;", "4f", lambda k: None),
        ("actuator_outputs", 0, outputs, "I4f", lambda k: (4, 0.0, 0.0, 0.0, 0.0)),
        ("actuator_outputs", 1, outputs, "I4f", lambda k: (4, *(1000.0 + 1000.0 * v["duty"][k]))),
        ("battery_status", 0, power, "2f", lambda k: (0.0, 0.0)),
        ("battery_status", 1, power, "2f", lambda k: (BATTERY, 2.0)),
        ("battery_status", 2, power, "2f", lambda k: (2.0, 2.0)),
    ]
    path = write_ulog_topics(tmp_path / "f.ulg", flight, topics)
    result = open_flight(path)
    assert result.motor_voltage == pytest.approx(flight.motor_voltage[: len(result)], abs=5e-3)
    assert (row(result, "duty").instance, row(result, "battery").instance) == ("1", "1")
    assert "battery: instance 1 of battery_status (0, 1, 2); 0 without data" in result.notes
    other = open_flight(path, choices=choices_of(["battery=2"], ""))
    assert other.battery_voltage == pytest.approx(2.0)
    with pytest.raises(ValueError, match="no such instance; use one of 0, 1, 2"):
        open_flight(path, choices=choices_of(["battery_status=7"], ""))
    with pytest.raises(ValueError, match="use one of battery, duty"):
        open_flight(path, choices=choices_of(["gyro=1"], ""))


def test_dataflash_with_second_instances_only_is_read(dataflash, flight):
    numbered = ("IMU", "BAT", "GPS")
    result = dataflash(
        lambda name, v: [(name, (v[0], 1, *v[2:]) if name in numbered else v)] if (name, v[1]) != ("IMU", 1) else []
    )
    assert result.omega == pytest.approx(flight.omega[: len(result)], abs=2e-3)
    assert result.battery_voltage == pytest.approx(BATTERY)
    assert "gps" in result.readings


def test_telemetry_is_ordered_by_clock_of_vehicle(tlog, flight):
    days = 86_400.0
    result = tlog(host=lambda k: (k >= 100) * -10 * days + (k >= 200) * -3600.0 + (k >= 300) * 2400.0)
    n = len(result)
    assert n >= SAMPLES - 2
    assert result.valid.all()
    assert result.motor_voltage == pytest.approx(flight.motor_voltage[:n], abs=5e-3)
    assert any("clock was set 3 times" in note for note in result.notes)


def test_telemetry_in_unix_time_is_related_to_boot(tlog, flight):
    def change(k, message):
        if message.get_type() == "SERVO_OUTPUT_RAW":
            pulses = 1000.0 + 1000.0 * flight.motor_voltage[k] / BATTERY
            unix = 1_600_000_000_000_000 + message.time_usec
            message = mavlink.MAVLink_actuator_output_status_message(unix, 15, [*pulses, *[0.0] * 28])
            yield mavlink.MAVLink_system_time_message(unix, round((unix - 1_600_000_000_000_000) / 1000))
        yield message

    result = tlog(change, lambda k: 3600.0 * (k >= 150))
    assert result.motor_voltage == pytest.approx(flight.motor_voltage[: len(result)], abs=5e-3)
    assert result.valid.all()


def test_usd_log_of_version_1_has_milliseconds(tmp_path, flight):
    flight_writers.write_usd(tmp_path / "log01", flight, version=1)
    result = open_flight(tmp_path / "log01")
    assert len(result) == SAMPLES
    assert result.position == pytest.approx(flight.position, abs=1e-5)
    assert result.interval == pytest.approx(INTERVAL)


@pytest.mark.long
def test_command_ends_with_table_and_takes_instance(tmp_path, flight):
    power = ULOG["battery_status"]
    topics = [("battery_status", n, power, "2f", lambda k, n=n: (n * 3.0, 1.0)) for n in (0, 1, 2)]
    path = write_ulog_topics(tmp_path / "f.ulg", flight, topics)
    command = ["import", path, "--out", tmp_path / "f.mcap"]
    done = run_command(*command, "--instance", "battery=2", code=0)
    lines = done.stdout.splitlines()
    head = next(k for k, line in enumerate(lines) if line.startswith(" signal "))
    cells = {line.split()[0]: line.split() for line in lines[head + 1 :] if line.strip()}
    assert cells["position"][1:] == [LOCAL, "NED,", "local", "400", "-"]
    assert cells["origin"] == ["origin"]
    assert cells["battery"][1:3] == ["battery_status", "2"]
    assert FlightData.read(tmp_path / "f.mcap").topic("battery").voltage == pytest.approx(6.0)
    assert_rejected(run_command(*command, "--instance", "battery"), "expected NAME=N")
