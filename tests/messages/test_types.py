"""Types of messages: hashes, compatibility, differences, attachments."""

import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from lapwing.cosim.log.log_reader import first_type_difference
from lapwing.messages import TYPES, Imu, Status, VehicleState, header, topics
from lapwing.messages.attachment import pack, time_and_gid
from lapwing.messages.message_diff import first_difference
from lapwing.messages.parse import parse
from lapwing.messages.topics import CLOCK, EVENTS, GPS, TOPICS, WALL_TIME
from lapwing.messages.types import unit
from lapwing.services.ros2.node import known_type_hash, type_hash

STANDARD = get_typestore(Stores.ROS2_JAZZY)
PUBLISHED = {  # from rmw_zenoh's documentation and ROS 2 nodes
    "std_msgs/msg/String": "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
    "std_msgs/msg/Header": "RIHS01_f49fb3ae2cf070f793645ff749683ac6b06203e41c891e17701b1cb597ce6a01",
}


@pytest.mark.parametrize(("name", "published"), PUBLISHED.items())
def test_hash_equals_published(name, published):
    assert known_type_hash(name) == published


@pytest.mark.parametrize("name", TYPES)
def test_hash_equals_rosbags_library(name):
    """Compare with the library's definitions of standard types, and with Lapwing's text for the others."""
    store = STANDARD
    if name not in STANDARD.fielddefs:
        store = get_typestore(Stores.EMPTY)
        store.register(get_types_from_msg(TYPES[name].schema_text, name))
    assert known_type_hash(name) == store.hash_rihs01(name)


def test_hash_covers_every_kind_of_field():
    text = """
bool a
byte b
int8 d
uint8 e
int16 f
uint16 g
int32 h
uint32 i
int64 j
uint64 k
float32 l
float64[3] m
string[] n
Other o
Other[] p
uint8 CONSTANT=1
"""
    other = "float32[] x\n"
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(other, "own/msg/Other") | get_types_from_msg(text, "own/msg/Every"))
    definitions = {name: parse(name, t) for name, t in (("own/msg/Every", text), ("own/msg/Other", other))}
    assert type_hash("own/msg/Every", definitions) == store.hash_rihs01("own/msg/Every")


STATE = "lapwing_msgs/msg/VehicleState"
TEXT = TYPES[STATE].schema_text


@pytest.mark.parametrize("name", TYPES)
def test_every_type_is_compatible_with_itself(name):
    text = TYPES[name].schema_text
    assert first_type_difference(name, text) == ""
    assert (
        first_type_difference(name, "# of another program\n" + text.replace("\n", "\r\n").replace("uint8 ", "char "))
        == ""
    )


def test_nested_types_may_have_any_order():
    bar = "=" * 80 + "\n"
    own, *others = TEXT.split(bar)
    ended = [part if part.endswith("\n") else part + "\n" for part in reversed(others)]
    assert first_type_difference(STATE, bar.join([own, *ended])) == ""
    assert first_type_difference("foreign/msg/A", "anything <= 3") == ""
    assert first_type_difference(STATE, "") == ""


@pytest.mark.parametrize(
    ("current", "recorded", "output"),
    [
        ("float64 air_density", "float32 air_density", "has float32 air_density where this version has float64 air_"),
        ("float64 air_density", "#", "has bool ground_contact where this version has float64 air_density"),
        ("bool ground_contact", "#", "has no more fields where this version has bool ground_contact"),
        (
            "bool ground_contact",
            "bool ground_contact\nint8 more",
            "has int8 more where this version has no more fields",
        ),
        ("float64[] rotor_speed", "float64[4] rotor_speed", "has float64[4] rotor_speed where"),
        ("float64 x", "float32 x", "has float32 pose.position.x where this version has float64 pose.position.x"),
        ("float64 air_density", "wide<=3 air_density", "has a definition that cannot be read"),
    ],
)
def test_first_type_difference_is_named(current, recorded, output):
    assert current in TEXT
    assert first_type_difference(STATE, TEXT.replace(current, recorded)).startswith(output)


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


GID = bytes(range(16))


def test_layout_byte_by_byte():
    assert pack(1, 2, GID) == b"\1" + bytes(7) + b"\2" + bytes(7) + b"\x10" + GID
    assert len(pack(-1, 2**62, GID)) == 33


def test_attachment_round_trips():
    assert time_and_gid(pack(7, 123456789012, GID)) == (123456789012, GID)
    assert time_and_gid(pack(7, -5, GID)) == (-5, GID)


def test_invalid_attachment_is_rejected():
    with pytest.raises(ValueError, match="15 bytes, expected 16"):
        pack(0, 0, GID[:15])
    for damaged in (b"", pack(0, 0, GID)[:-1], pack(0, 0, GID) + b"\0", bytes(16) + b"\x11" + GID):
        with pytest.raises(ValueError, match="not an attachment"):
            time_and_gid(damaged)


EXPECTED = {
    "/clock", "/tf", "/wall_time",
    *(f"/drone1/{name}" for name in (
        "ground_truth", "pose", "odom", "imu", "mag", "gps/fix", "baro", "sonar", "battery", "setpoint", "estimate",
        "actuators", "status",
    )),
}  # fmt: skip


def test_documented_topics_exist():
    assert {topic.key("drone1") for topic in TOPICS} >= EXPECTED
    assert len({topic.name for topic in TOPICS}) == len(TOPICS)


def test_topic_keys():
    assert GPS.key("drone1") == "/drone1/gps/fix"
    assert GPS.zenoh_key("drone1", "lapwing/7") == "lapwing/7/drone1/gps/fix"
    assert CLOCK.key() == "/clock"
    assert CLOCK.zenoh_key("drone1", "lapwing") == "lapwing/clock"


def test_every_topic_has_message_class_and_digest_flag():
    assert all(topic.message().encode() for topic in TOPICS)
    assert [topic for topic in TOPICS if not topic.deterministic] == [WALL_TIME, EVENTS]
    assert all(getattr(topics, name) in TOPICS for name in ("TRUTH", "IMU", "TF"))
