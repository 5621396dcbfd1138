from lapwing.messages import topics
from lapwing.messages.topics import CLOCK, EVENTS, GPS, TOPICS, WALL_TIME

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
