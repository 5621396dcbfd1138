"""Imports of rosbag2 folders with setpoints, pulses of motors, and no throttles."""

from types import SimpleNamespace

import numpy as np
import pytest
from flight_writers import GRAVITY, INTERVAL, SAMPLES

from lapwing.flights.log_import.open_flight import open_flight
from tests.commands import assert_rejected, run_command


def write_bag(path, topics, storage="MCAP"):
    """Write a bag of messages (type, make(k, header)) by topic and number of messages per sample."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    types = get_typestore(Stores.ROS2_HUMBLE)
    types.register(get_types_from_msg("std_msgs/Header header\nuint16[] channels\n", "mavros_msgs/msg/RCOut"))
    text = "std_msgs/Header header\nfloat64[] position\nfloat64[] velocity\nfloat64[] normalized\n"
    types.register(get_types_from_msg(text, "actuator_msgs/msg/Actuators"))
    make = SimpleNamespace(**{name.rsplit("/", 1)[1]: kind for name, kind in types.types.items()})
    with Writer(path, version=9, storage_plugin=StoragePlugin[storage]) as writer:
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
    (file,) = (tmp_path / "bag").glob("*.mcap")
    (tmp_path / "bag" / "metadata.yaml").unlink()
    assert np.array_equal(open_flight(file).position, result.position, equal_nan=True)


def test_bag_without_throttles_has_no_motor_outputs(tmp_path):
    write_bag(tmp_path / "bag", {**BAG, "/motors": ("actuator_msgs/msg/Actuators", 1, no_shares)})
    with pytest.raises(ValueError, match="no motor outputs"):
        open_flight(tmp_path / "bag")


FLEET = {
    f"/{name}{topic}": (kind, 1, content)
    for name, height in (("red", 2.0), ("blue", 5.0))
    for topic, kind, content in (
        ("/pose", "geometry_msgs/msg/PoseStamped", pose(height)),
        ("/imu", "sensor_msgs/msg/Imu", imu),
        ("/rc/out", "mavros_msgs/msg/RCOut", pulses),
    )
}


def test_bag_of_several_vehicles_needs_a_name(tmp_path):
    write_bag(tmp_path / "bag", FLEET)
    with pytest.raises(ValueError, match=r"several vehicles: blue, red; choose one with --vehicle"):
        open_flight(tmp_path / "bag")
    with pytest.raises(ValueError, match="no motor outputs of --vehicle green; use one of blue, red"):
        open_flight(tmp_path / "bag", vehicle="green")
    result = open_flight(tmp_path / "bag", vehicle="blue")
    assert result.position[:, 2] == pytest.approx(5.0)
    assert "/red/imu" in result.unknown


@pytest.mark.long
def test_command_imports_database_with_and_without_metadata(tmp_path):
    write_bag(tmp_path / "bag", {**BAG, "/mavros/rc/out": ("mavros_msgs/msg/RCOut", 1, pulses)}, "SQLITE3")
    (file,) = (tmp_path / "bag").glob("*.db3")
    heights = []
    for source in (tmp_path / "bag", file, file):
        command = ["import", source, "--out", tmp_path / f"{len(heights)}.mcap"]
        run_command(*command, code=0)
        heights.append(open_flight(command[-1]).position[:, 2])
        (tmp_path / "bag" / "metadata.yaml").unlink(missing_ok=True)
    assert heights[0] == pytest.approx(2.0)
    assert all(np.array_equal(each, heights[0], equal_nan=True) for each in heights)
    file.write_bytes(file.read_bytes()[:8192])
    assert_rejected(run_command(*command), f"{file.name}: is not a readable rosbag2")


@pytest.mark.long
def test_command_selects_vehicle_of_bag(tmp_path):
    write_bag(tmp_path / "bag", FLEET)
    command = ["import", tmp_path / "bag", "--out", tmp_path / "f.mcap"]
    run_command(*command, "--vehicle", "red", code=0)
    assert open_flight(tmp_path / "f.mcap").position[:, 2] == pytest.approx(2.0)
    assert_rejected(run_command(*command))
    log = ["import", tmp_path / "f.mcap", "--out", tmp_path / "g.mcap"]
    assert_rejected(run_command(*log), "is a Lapwing log already; use it without import")
    (tmp_path / "f.mcap").write_bytes(b"")
    assert_rejected(run_command(*log), "f.mcap: is empty; expected a log (MCAP)")
