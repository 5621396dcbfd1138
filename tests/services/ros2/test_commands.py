"""Commands of other ROS 2 nodes, and their conversion."""

import math

import pytest

from lapwing.messages import (
    Actuators,
    Bool,
    OperatorCommand,
    OperatorInput,
    Point,
    Pose,
    PoseStamped,
    Quaternion,
    Setpoint,
    String,
    Twist,
    TwistStamped,
    Vector3,
    header,
)
from lapwing.services.ros2.commands import Commands

NAN = math.nan
QUARTER = math.sqrt(0.5)


@pytest.fixture
def commands():
    return Commands("drone1")


@pytest.mark.parametrize(
    ("name", "message", "kind", "values"),
    [
        ("arm", Bool(True), "arm", ()),
        ("arm", Bool(False), "disarm", ()),
        ("mode", String("land"), "land", ()),
        (  # turned to the left by a quarter: north
            "pose",
            PoseStamped(header(0, "world"), Pose(Point(1.0, 2.0, 3.0), Quaternion(0.0, 0.0, QUARTER, QUARTER))),
            "offboard_position",
            (1.0, 2.0, 3.0, *[NAN] * 6, math.pi / 2.0, NAN),
        ),
        (
            "velocity",
            TwistStamped(header(0, ""), Twist(Vector3(1.0, 2.0, 3.0), Vector3(0.1, 0.2, 0.3))),
            "offboard_position",
            (*[NAN] * 3, 1.0, 2.0, 3.0, *[NAN] * 4, 0.3),
        ),
        (
            "setpoint",
            Setpoint(
                header(0, "world"), Vector3(1.0, 2.0, 3.0), Vector3(4.0, 5.0, 6.0), Vector3(7.0, 8.0, 9.0), 10.0, 11.0
            ),
            "offboard_position",
            tuple(map(float, range(1, 12))),
        ),
        ("motors", Actuators(header(0, ""), (1.0, 2.0, 3.0, 4.0), True), "offboard_motors", (1.0, 2.0, 3.0, 4.0)),
    ],
)
def test_message_is_command(commands, name, message, kind, values):
    assert commands.messages[f"/drone1/command/{name}"] is type(message)
    (command,) = commands.read(f"/drone1/command/{name}", message.encode())
    assert (command.kind, command.source, command.id) == (kind, "ros2", 1)
    assert command.values == pytest.approx(values, abs=1e-12, nan_ok=True)


def test_all_commands_are_accepted_with_source(commands):
    values = (OperatorCommand("goto", "255/190", 7, (1.0, 2.0, 3.0)), OperatorCommand("land", "", 8))
    result = commands.read("/drone1/command/operator", OperatorInput(header(0, "world"), values).encode())
    assert result == (values[0]._replace(source="ros2/255/190"), values[1]._replace(source="ros2/"))
    assert commands.report() == "2 commands accepted"


def test_unknown_message_is_counted_and_ignored(commands):
    elsewhere = PoseStamped(header(0, "base_link"))
    assert commands.read("/drone1/command/arm", b"no message") == ()
    assert commands.read("/drone1/command/pose", elsewhere.encode()) == ()
    assert commands.report() == (
        "0 commands accepted, 2 messages rejected, the last one: /drone1/command/pose: frame base_link: expected world"
    )
