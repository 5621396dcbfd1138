"""Imports of logs with several sources, restarts, unknown values and other vehicles."""

from dataclasses import replace
from types import SimpleNamespace

import flight_writers
import numpy as np
import pytest
from flight_recordings import BATTERY
from flight_writers import DATAFLASH, GRAVITY, INTERVAL, SAMPLES, dataflash_rows, telemetry, write_bin, write_tlog
from pymavlink.dialects.v20 import common as mavlink

from lapwing.cosim.log import LogWriter
from lapwing.studies.flight_import.open_flight import open_flight
from lapwing.studies.flight_import.write_log import write_log


@pytest.fixture
def dataflash(tmp_path, flight, monkeypatch):
    """Return the import of a dataflash log whose rows, and types of messages, a test changes."""

    def imported(change, types=()):
        path = tmp_path / "f.bin"
        rows = [new for row in dataflash_rows(flight) for new in change(*row)]
        for name, entry in dict(types).items():
            monkeypatch.setitem(DATAFLASH, name, entry)
        with monkeypatch.context() as patch:
            patch.setattr(flight_writers, "dataflash_rows", lambda flight: iter(rows))
            write_bin(path, flight)
        return open_flight(path)

    return imported


@pytest.fixture
def tlog(tmp_path, flight, monkeypatch):
    """Return the import of a telemetry log whose messages of each sample a test changes."""

    def imported(change):
        path = tmp_path / "f.tlog"
        with monkeypatch.context() as patch:
            patch.setattr(
                flight_writers, "telemetry", lambda v, k: [new for m in telemetry(v, k) for new in change(k, m)]
            )
            write_tlog(path, flight)
        return open_flight(path)

    return imported


def check(result, flight):
    n = len(result)
    assert n >= SAMPLES - 2
    assert result.valid.all()
    assert result.position == pytest.approx(flight.position[:n], abs=2e-3)
    assert np.abs((result.attitude * flight.attitude[:n]).sum(axis=1)) == pytest.approx(np.ones(n), abs=1e-6)
    assert result.omega == pytest.approx(flight.omega[:n], abs=2e-3)
    assert result.motor_voltage == pytest.approx(flight.motor_voltage[:n], abs=5e-3)
    assert result.battery_voltage == pytest.approx(np.full(n, BATTERY), abs=1e-3)


def test_dataflash_follows_primary_core(dataflash, flight):
    def change(name, values):
        if name == "XKF1":
            yield "XKF4", (values[0], 0, 1)
            yield name, (*values[:-1], values[-1] + 5.0)
            yield name, (values[0], 1, *values[2:])
        elif name == "XKQ":
            yield name, (*values[:2], 1.0, 0.0, 0.0, 0.0)
            yield name, (values[0], 1, *values[2:])
        else:
            yield name, values

    result = dataflash(change, {"XKF4": (72, "QBb", "TimeUS,C,PI")})
    check(result, flight)
    assert "EKF core 1 was primary" in result.notes


def test_second_battery_of_former_dataflash_is_ignored(dataflash, flight):
    def change(name, values):
        if name == "BAT":
            yield name, (values[0], 1, 1.0, 1.0)
        yield name, values

    check(dataflash(change, {"BAT": (69, "QBff", "TimeUS,Instance,Volt,Curr")}), flight)


def test_damaged_time_hides_single_sample(dataflash, flight):
    def change(name, values):
        damaged = name == "IMU" and values[0] == 6_000_000 and values[1] == 0
        yield name, (values[0] + (damaged << 40), *values[1:])

    result = dataflash(change)
    assert result.faults == {"time not increasing": 2}  # gyroscope and accelerometer
    check(result, flight)


def test_log_of_plane_is_rejected(dataflash):
    def change(name, values):
        yield name, (*values[:2], 4.0) if name == "PARM" and values[1].startswith(b"SERVO") else values

    with pytest.raises(ValueError, match="expected a multirotor"):
        dataflash(change)


def test_motor_on_unlogged_output_is_rejected(dataflash):
    def change(name, values):
        yield name, (0, b"SERVO20_FUNCTION", 36.0) if name == "PARM" and values[1] == b"SERVO4_FUNCTION" else values

    with pytest.raises(ValueError, match="no motor outputs C20 in RCOU"):
        dataflash(change)


def test_dataflash_without_fix_has_no_positions_of_gps(dataflash, flight):
    def change(name, values):
        yield name, (*values[:2], 1 if values[0] < 7_000_000 else 3, *values[2:]) if name == "GPS" else values

    result = dataflash(change, {"GPS": (70, "QBBIHLLf", "TimeUS,I,Status,GMS,GWk,Lat,Lng,Alt")})
    assert result.readings["gps"].time[0] >= 2.0 - 1e-6
    check(result, flight)


@pytest.mark.parametrize("volts", [0.0, np.nan])
def test_unmeasured_battery_gives_shares_of_voltage(dataflash, flight, volts):
    result = dataflash(lambda name, v: [(name, (*v[:2], volts, 0.0) if name == "BAT" else v)])
    assert result.motor_voltage == pytest.approx(flight.motor_voltage[: len(result)] / BATTERY, abs=2e-3)
    assert any("no battery voltage" in note for note in result.notes)


def test_battery_without_first_readings_keeps_one_unit(dataflash, flight):
    result = dataflash(lambda name, v: [(name, (*v[:2], 0.0, 0.0) if name == "BAT" and v[0] < 6_500_000 else v)])
    check(result, flight)
    assert result.faults == {"battery not measured": 150}


@pytest.mark.parametrize("name", ["f.bin", "f.tlog"])
def test_longest_part_between_restarts_is_imported(tmp_path, flight, name):
    write, path = flight_writers.WRITERS[name], tmp_path / name
    short = replace(flight, **{
        field: getattr(flight, field)[200:]
        for field in ("position", "attitude", "velocity", "omega", "specific_force", "motor_voltage",
                      "battery_voltage", "valid")
    })  # fmt: skip
    write(path, short)
    first = path.read_bytes()
    write(path, flight)
    path.write_bytes(first + path.read_bytes())
    result = open_flight(path)
    check(result, flight)
    assert any("the longest of 2 parts" in note for note in result.notes)


def test_telemetry_of_other_port_is_ignored(tlog, flight):
    def change(k, message):
        yield message
        if message.get_type() == "SERVO_OUTPUT_RAW":
            yield mavlink.MAVLink_servo_output_raw_message(message.time_usec + 5000, 1, *[1000 + k] * 8)

    check(tlog(change), flight)


def test_time_stamp_of_32_bits_wraps(tlog, flight, monkeypatch):
    monkeypatch.setattr(flight_writers, "BOOT", 2**32 * 1e-6 - 2.0)
    check(tlog(lambda k, message: [message]), flight)


def test_actuator_outputs_may_be_pulses(tlog, flight):
    def change(k, message):
        if message.get_type() == "SERVO_OUTPUT_RAW":
            pulses = 1000.0 + 1000.0 * flight.motor_voltage[k] / BATTERY
            yield mavlink.MAVLink_actuator_output_status_message(message.time_usec, 15, [*pulses, *[0.0] * 28])
        else:
            yield message

    check(tlog(change), flight)


def test_unknown_values_of_telemetry_are_not_numbers(tlog):
    def change(k, message):
        if message.get_type() == "SYS_STATUS":
            message.voltage_battery, message.current_battery = 65535, -1
        if message.get_type() == "GPS_RAW_INT":
            message.fix_type = 1
        yield message

    result = tlog(change)
    assert np.isnan(result.battery_voltage).all()
    assert "gps" not in result.readings


def test_unknown_current_leaves_voltage(tlog, flight):
    def change(k, message):
        if message.get_type() == "SYS_STATUS":
            message.current_battery = -1
        yield message

    result = tlog(change)
    check(result, flight)
    assert np.isnan(result.power).all()


def test_telemetry_of_rover_is_rejected(tlog):
    def change(k, message):
        yield mavlink.MAVLink_heartbeat_message(10, 3, 0, 0, 4, 3) if message.get_type() == "HEARTBEAT" else message

    with pytest.raises(ValueError, match="log of a rover; expected a multirotor"):
        tlog(change)


def test_parameters_in_telemetry_name_motors(tlog, flight):
    def change(k, message):
        if k == 0 and message.get_type() == "SYS_STATUS":
            for n, function in enumerate((35, 33, 34, 36), 1):
                yield mavlink.MAVLink_param_value_message(b"SERVO%d_FUNCTION" % n, function, 4, 100, n)
        if message.get_type() == "SERVO_OUTPUT_RAW":
            m1, m2, m3, m4 = (getattr(message, f"servo{n}_raw") for n in (1, 2, 3, 4))
            gimbal = 1000 + k
            message = mavlink.MAVLink_servo_output_raw_message(message.time_usec, 0, m3, m1, m2, m4, gimbal, 0, 0, 0)
        yield message

    check(tlog(change), flight)


def test_second_rangefinder_is_ignored(tlog):
    def change(k, message):
        yield message
        if message.get_type() == "SYS_STATUS":
            for number, orientation, distance in ((0, 0, 700), (1, 25, 300)):
                ms = 5000 + 10 * k
                yield mavlink.MAVLink_distance_sensor_message(ms, 10, 1000, distance, 0, number, orientation, 0)

    assert np.unique(tlog(change).readings["rangefinder"].values) == pytest.approx([3.0])


def test_fast_csv_keeps_its_time_base(tmp_path):
    from lapwing.studies.flight_import.column_mapping import load_mapping
    from lapwing.studies.flight_import.csv_flight import from_columns

    mapping = load_mapping("betaflight")
    n = 3200
    time = np.floor(312.5 * np.arange(n))
    table = {column: np.zeros(n) for column in mapping.columns}
    table |= {"time (us)": time, "accSmooth[2]": np.full(n, 2048.0), "vbatLatest (V)": np.full(n, 16.0)}
    table |= {f"motor[{k}]": np.full(n, 500.0) for k in range(4)} | {"gyroADC[0]": np.sin(time * 1e-6)}
    result = from_columns(tmp_path / "f.csv", table, mapping)
    at = result.interval * np.arange(len(result))
    assert at[-1] == pytest.approx(time[-1] * 1e-6, abs=1e-3)
    assert result.omega[:, 0] == pytest.approx(np.radians(np.sin(at)), abs=1e-6)


def write_bag(path, topics):
    """Write a bag of messages (type, make(k, header)) by topic and number of messages per sample."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    types = get_typestore(Stores.ROS2_HUMBLE)
    types.register(get_types_from_msg("std_msgs/Header header\nuint16[] channels\n", "mavros_msgs/msg/RCOut"))
    text = "std_msgs/Header header\nfloat64[] position\nfloat64[] velocity\nfloat64[] normalized\n"
    types.register(get_types_from_msg(text, "actuator_msgs/msg/Actuators"))
    make = SimpleNamespace(**{name.rsplit("/", 1)[1]: kind for name, kind in types.types.items()})
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for topic, (kind, count, content) in topics.items():
            connection = writer.add_connection(topic, kind, typestore=types)
            for k in range(count * SAMPLES):
                ns = 1_700_000_000_000_000_000 + round(k * INTERVAL / count * 1e9)
                header = make.Header(make.Time(ns // 10**9, ns % 10**9), "map")
                writer.write(connection, ns, types.serialize_cdr(content(k, header, make), kind))


def pose(height):
    def content(k, header, make):
        return make.PoseStamped(header, make.Pose(make.Point(0.0, 0.0, height), make.Quaternion(0.0, 0.0, 0.0, 1.0)))

    return content


def imu(k, header, make):
    still, nine = make.Vector3(0.0, 0.0, 0.0), np.zeros(9)
    return make.Imu(
        header, make.Quaternion(0.0, 0.0, 0.0, 1.0), nine, still, nine, make.Vector3(0.0, 0.0, GRAVITY), nine
    )


def pulses(k, header, make):
    return make.RCOut(header, np.array([1300 + 10 * n + k % 2 for n in range(6)] + [1500, 0], np.uint16))


def no_shares(k, header, make):
    return make.Actuators(header, np.zeros(0), np.full(4, 500.0), np.zeros(0))


BAG = {
    "/mavros/setpoint_position/local": ("geometry_msgs/msg/PoseStamped", 2, pose(9.0)),
    "/mavros/local_position/pose": ("geometry_msgs/msg/PoseStamped", 1, pose(2.0)),
    "/mavros/imu/data": ("sensor_msgs/msg/Imu", 1, imu),
}


def test_bag_of_mavros_hexacopter(tmp_path):
    write_bag(tmp_path / "bag", {**BAG, "/mavros/rc/out": ("mavros_msgs/msg/RCOut", 1, pulses)})
    result = open_flight(tmp_path / "bag")
    assert result.position[:, 2] == pytest.approx(2.0)
    assert "/mavros/setpoint_position/local" in result.unknown
    assert result.rotors == 6
    assert result.motor_voltage[0] == pytest.approx([0.30, 0.31, 0.32, 0.33, 0.34, 0.35], abs=1e-3)


def test_bag_without_throttles_has_no_motor_outputs(tmp_path):
    write_bag(tmp_path / "bag", {**BAG, "/motors": ("actuator_msgs/msg/Actuators", 1, no_shares)})
    with pytest.raises(ValueError, match="no motor outputs"):
        open_flight(tmp_path / "bag")


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
