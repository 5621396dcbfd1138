"""Logs of earlier versions: recordings made before topics, types and fields were renamed."""

import json
from pathlib import Path

import pytest

from lapwing.cosim.config.serialise import from_json, to_json
from lapwing.cosim.log import LogReader
from lapwing.messages import TYPES, MissionItem, OperatorInput
from lapwing.messages.former_names import current_topic, current_type
from lapwing.messages.topics import TOPICS

FORMER = Path(__file__).parent / "former_names"  # recorded on 2026-11-23


def test_renamed_topics_of_mission_are_read_by_current_names():
    with LogReader(FORMER / "delivery.plan.mcap") as log:
        names = log.topics()
        columns = log.histories()
        assert log.incompatible_types() == {}
        commands = [OperatorInput.decode(m) for *_, m in log.messages(["/drone1/vehicle_command"])]
    assert {"/drone1/ground_truth", "/drone1/vehicle_command", "/drone1/vehicle_command_ack"} <= set(names)
    assert not {"/drone1/truth", "/drone1/operator", "/drone1/answers"} & set(names)
    assert columns["/drone1/status"][1]["arming_blockers"] is not None
    assert len(columns["/drone1/estimate"][1]["health_flags"]) > 5
    items = [item for m in commands for c in m.commands for item in c.items]
    assert items
    assert all(item.hold_time >= 0.0 for item in items)


def test_renamed_type_is_read_by_its_current_name():
    with LogReader(FORMER / "cooperative_load.mcap") as log:
        wrench = {topic: kind for topic, kind in log.topics().items() if topic.endswith("/rotor_wrench")}
        assert set(wrench.values()) == {"lapwing_msgs/msg/RotorWrench"}
        (topic,) = wrench
        assert log.history(topic)[1]["thrust"].shape[1] == 2
        assert any(topic.endswith("/body_states") for topic in log.topics())


def test_digest_of_former_log_uses_recorded_names():
    with LogReader(FORMER / "delivery.plan.mcap") as log:
        assert log.digest() == log.metadata["digest"]
        assert log.digest(current_names=True) != log.digest()


@pytest.mark.parametrize("topic", TOPICS, ids=lambda topic: topic.name)
def test_current_topics_keep_their_names(topic):
    assert current_topic(topic.key("drone1"), topic.message.type_name) == topic.key("drone1")


def test_topics_of_other_programs_keep_their_names():
    assert current_topic("/robot/truth", "nav_msgs/msg/Odometry") == "/robot/truth"
    assert current_topic("/a/own_sensor/x", "lapwing_msgs/msg/Reading") == "/a/custom_sensor/x"
    assert all(current_type(name) == name for name in TYPES)


def test_serialised_message_with_former_fields_is_read():
    item = MissionItem("delay", hold_time=3.0)
    tree = json.loads(to_json(item))
    tree["hold"] = tree.pop("hold_time")
    assert from_json(json.dumps(tree)) == item
