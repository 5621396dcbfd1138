"""First difference of two messages, and units of fields."""

import pytest

from lapwing.messages import Imu, Status, VehicleState, header
from lapwing.messages.message_diff import first_difference
from lapwing.messages.types import unit


def test_first_different_field_has_both_values():
    one = Imu(header(5, "base"))
    other = one._replace(linear_acceleration=(0.0, 9.81, 1.0))
    result = first_difference(Imu, one.encode(), other.encode())
    assert (result.field, result.one, result.other, result.delta) == ("linear_acceleration.y", 0.0, 9.81, 9.81)
    assert first_difference(Imu, one.encode(), one.encode()) is None
    text = first_difference(Status, Status(mode="a").encode(), Status(mode="b").encode())
    assert (text.field, text.delta) == ("mode", None)


def test_negative_zero_differs_from_zero():
    one, other = (Imu(linear_acceleration=(x, 0.0, 0.0)).encode() for x in (0.0, -0.0))
    assert first_difference(Imu, one, other).field == "linear_acceleration.x"


def test_sequences_of_different_lengths_differ():
    one, other = (VehicleState(rotor_speed=(1.0,) * n).encode() for n in (3, 4))
    assert first_difference(VehicleState, one, other) is not None


@pytest.mark.parametrize(
    ("kind", "field", "expected"),
    [
        ("lapwing_msgs/msg/VehicleState", "rotor_speed.2", "rad/s"),
        ("lapwing_msgs/msg/VehicleState", "velocity.x", "m/s"),  # unit of the containing vector
        ("lapwing_msgs/msg/VehicleState", "pose.position.z", "m"),
        ("lapwing_msgs/msg/VehicleState", "pose.orientation.w", ""),
        ("lapwing_msgs/msg/BodyStates", "velocity.3.x", "m/s"),
        ("nav_msgs/msg/Odometry", "twist.twist.angular.z", "rad/s"),
        ("sensor_msgs/msg/NavSatFix", "latitude", "deg"),
        ("sensor_msgs/msg/Imu", "header.stamp.sec", ""),
        ("lapwing_msgs/msg/Status", "mode", ""),
    ],
)
def test_units_are_those_of_definitions(kind, field, expected):
    assert unit(kind, field) == expected
