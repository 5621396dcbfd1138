"""Frames of a rosbag2: the axes of an odometry's velocity, and gyroscopes of cameras."""

import numpy as np
import pytest
from flight_recordings import BATTERY
from scipy.spatial.transform import Rotation

from lapwing.flights.log_import.open_flight import open_flight
from tests.commands import assert_rejected, run_command
from tests.flights.log_import.test_rosbag import write_bag

ODOMETRY = "nav_msgs/msg/Odometry"


def bag(path, flight, child="base_link", in_world=False, cameras=(), world="map", body="base_link", boot=0):
    """Write a bag of a flight whose odometry has the velocity in body or world axes, and gyroscopes of cameras.

    Args:
        boot: time of the odometry's clock [s] that the others do not have.
        cameras: factor of the rate, and name of the frame, of each camera; the vehicle has a gyroscope without one.
    """
    velocity = flight.velocity
    if not in_world:
        velocity = Rotation.from_quat(flight.attitude[:, [1, 2, 3, 0]]).inv().apply(flight.velocity)

    def odometry(k, header, make):
        w, x, y, z = flight.attitude[k]
        pose = make.Pose(make.Point(*flight.position[k]), make.Quaternion(x, y, z, w))
        twist = make.Twist(make.Vector3(*velocity[k]), make.Vector3(0.0, 0.0, 0.0))
        covariance = np.zeros(36)
        stamp = make.Time(header.stamp.sec - boot, header.stamp.nanosec)
        return make.Odometry(
            make.Header(stamp, world),
            child,
            make.PoseWithCovariance(pose, covariance),
            make.TwistWithCovariance(twist, covariance),
        )

    def inertial(turned, frame, count):
        def content(k, header, make):
            omega = flight.omega[k // count]
            rates = make.Vector3(*(omega[[2, 0, 1]] * [-1.0, 1.0, -1.0] if turned else omega))
            nine, header = np.zeros(9), make.Header(header.stamp, frame)
            force = make.Vector3(*flight.specific_force[k // count])
            return make.Imu(header, make.Quaternion(0.0, 0.0, 0.0, 1.0), nine, rates, nine, force, nine)

        return "sensor_msgs/msg/Imu", count, content

    def motors(k, header, make):
        return make.Actuators(header, np.zeros(0), np.zeros(0), flight.motor_voltage[k] / BATTERY)

    topics = {"/odom": (ODOMETRY, 1, odometry), "/motors": ("actuator_msgs/msg/Actuators", 1, motors)}
    topics["/imu"] = inertial(False, body, 1)
    for count, frame in cameras:
        topics[f"/{frame}/imu"] = inertial(True, frame, count)
    write_bag(path, topics)
    return path


@pytest.mark.long
def test_twist_that_contradicts_position(tmp_path, flight):
    path = bag(tmp_path / "bag", flight, in_world=True)
    command = ["import", path, "--out", tmp_path / "f.mcap"]
    assert_rejected(run_command(*command), "contradicts the derivative of its position", "use --twist-frame world")
    run_command(*command, "--twist-frame", "world", code=0)
    result = open_flight(tmp_path / "f.mcap")
    assert result.velocity == pytest.approx(flight.velocity[: len(result)], abs=1e-6)


def test_twist_is_in_axes_of_child_frame(tmp_path, flight):
    for name, child, in_world in (("body", "base_link", False), ("world", "odom", True)):
        result = open_flight(bag(tmp_path / name, flight, child, in_world))
        assert result.velocity == pytest.approx(flight.velocity[: len(result)], abs=1e-6)


@pytest.mark.parametrize("frame", ["camera", "sensor"])
def test_gyroscope_of_camera_is_rejected(tmp_path, flight, frame):
    result = open_flight(bag(tmp_path / "bag", flight, cameras=[(2, frame)]))
    assert result.omega == pytest.approx(flight.omega[: len(result)], abs=1e-6)
    assert any(f"/{frame}/imu turns differently" in note for note in result.notes)
