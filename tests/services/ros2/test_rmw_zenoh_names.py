"""Keys and tokens against zenoh-ros2-sdk, an independent implementation for the same middleware."""

import re
from pathlib import Path

import pytest

from lapwing.messages import TYPES
from lapwing.messages.attachment import pack
from lapwing.messages.parse import dependencies
from lapwing.messages.types import DEFINITIONS, FOLDER
from lapwing.services.ros2.node import PUBLISHER, SUBSCRIPTION, Endpoint, identifier, node_token

SESSION = "5a16d9fcc7d8d7d0a7d6c4a6d2a4d1b8"


def test_topic_key_equals_design_document():
    assert Endpoint("/chatter", "std_msgs/msg/String").key(0) == (
        "0/chatter/std_msgs::msg::dds_::String_/RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
    )


@pytest.mark.parametrize("kind", [PUBLISHER, SUBSCRIPTION])
@pytest.mark.parametrize("name", ["sensor_msgs/msg/Imu", "lapwing_msgs/msg/Status"])
def test_keys_and_tokens_equal_other_implementation(name, kind):
    pytest.importorskip("zenoh_ros2_sdk", reason="needs the extra `clients`")
    from zenoh_ros2_sdk import entity, keyexpr, qos, utils

    texts = {n: (c.schema_text.split("=" * 80))[0] for n, c in TYPES.items()}
    hashed = utils.get_type_hash(name, texts[name], texts)
    theirs = entity.EndpointEntity(
        entity.NodeEntity(7, SESSION, 0, "lapwing"),
        3,
        entity.EntityKind(kind),
        "/drone1/imu",
        utils.ros2_to_dds_type(name),
        hashed,
        qos.DEFAULT_QOS_PROFILE.encode(),
    )
    ours = Endpoint("/drone1/imu", name)
    assert ours.key(7) == keyexpr.topic_keyexpr(7, "/drone1/imu", theirs.dds_type_name, hashed)
    assert ours.token(7, SESSION, 3, kind) == keyexpr.endpoint_liveliness_keyexpr(theirs)
    assert node_token(7, SESSION) == keyexpr.node_liveliness_keyexpr(theirs.node)


def test_attachment_equals_other_implementation():
    pytest.importorskip("zenoh_ros2_sdk", reason="needs the extra `clients`")
    from zenoh_ros2_sdk.attachment import Attachment

    gid = identifier(Endpoint("/chatter", "std_msgs/msg/String").token(0, SESSION, 1, PUBLISHER))
    assert pack(5, 7, gid) == Attachment(5, 7, gid).to_bytes()


def test_ros_package_declares_message_dependencies():
    package = Path("deploy/ros2/lapwing_msgs")
    assert (package / "msg").resolve() == (FOLDER / "lapwing_msgs").resolve()
    ours = [name for name in TYPES if name.startswith("lapwing_msgs/")]
    used = {t.split("/")[0] for name in ours for t in dependencies(name, DEFINITIONS)} - {"lapwing_msgs"}
    direct = {f.base.split("/")[0] for name in ours for f in DEFINITIONS[name].fields if f.nested} - {"lapwing_msgs"}
    named = set(re.findall("<depend>(.*)</depend>", (package / "package.xml").read_text()))
    assert direct == named <= used
    assert f"DEPENDENCIES {' '.join(sorted(named))})" in (package / "CMakeLists.txt").read_text()
