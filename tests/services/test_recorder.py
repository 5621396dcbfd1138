"""The recorder holds messages back until every service has handed over their ticks, and loses none."""

import numpy as np

from cosim.bundle import pack_batch
from cosim.wire import Page
from messages.topics import ACTUATORS, POSE, TRUTH
from services.recorder.service import Pending


def batch(topic, ticks, stop):
    ticks = np.array(ticks)
    return pack_batch(
        [Page(topic, ticks, ticks.astype("<i8").view(np.uint8).reshape(-1, 8))] if len(ticks) else [], stop
    )


def written(pending):
    return {
        page.topic.name: [int.from_bytes(p.tobytes(), "little") for p in page.payloads] for page in pending.complete()
    }


def test_messages_wait_for_the_slowest_service():
    pending = Pending(["plant", "autopilot"])
    pending.add("plant", batch(TRUTH, range(10), 10))
    assert written(pending) == {}
    pending.add("autopilot", batch(ACTUATORS, range(4), 4))
    assert written(pending) == {TRUTH.name: [0, 1, 2, 3], ACTUATORS.name: [0, 1, 2, 3]}
    assert written(pending) == {}
    pending.add("autopilot", batch(ACTUATORS, range(4, 12), 12))
    assert written(pending) == {TRUTH.name: list(range(4, 10)), ACTUATORS.name: list(range(4, 10))}
    assert pending.written == 10


def test_a_service_without_a_message_hands_over_its_ticks_too():
    pending = Pending(["plant", "trajectory"])
    pending.add("plant", batch(POSE, [0, 5], 7))
    assert pending.waits_for() == "the messages of trajectory from tick 0 on"
    pending.add("trajectory", batch(POSE, [], 6))
    assert written(pending) == {POSE.name: [0, 5]}


def test_it_ends_once_every_service_has_said_so():
    pending = Pending(["plant", "autopilot"])
    for name, topic in (("plant", TRUTH), ("autopilot", ACTUATORS)):
        pending.add(name, batch(topic, [0, 1], 2))
    pending.add("plant", b"")
    assert not pending.ended
    pending.add("autopilot", b"")
    assert pending.ended
    assert written(pending) == {TRUTH.name: [0, 1], ACTUATORS.name: [0, 1]}
