"""Recorder: a tick is complete after every service has published it; no message is lost."""

import numpy as np
import pytest

from lapwing.cosim.diagram.topic_encoder import RecordBatch
from lapwing.cosim.run_errors import LockStepError
from lapwing.cosim.transport.packets import pack_log_packet
from lapwing.messages.topics import ACTUATORS, POSE, TRUTH
from lapwing.services.recorder.service import Pending


def batch(topic, ticks, stop, start=0):
    ticks = np.array(ticks)
    pages = [RecordBatch(topic, ticks, ticks.astype("<i8").view(np.uint8).reshape(-1, 8))] if len(ticks) else []
    return pack_log_packet(pages, start, stop)


def complete_pages(pending):
    return {
        page.topic.name: [int.from_bytes(p.tobytes(), "little") for p in page.payloads] for page in pending.complete()
    }


def test_messages_wait_for_slowest_service():
    pending = Pending(["plant", "autopilot"])
    pending.add("plant", batch(TRUTH, range(10), 10), 0)
    assert complete_pages(pending) == {}
    pending.add("autopilot", batch(ACTUATORS, range(4), 4), 0)
    assert complete_pages(pending) == {TRUTH.name: [0, 1, 2, 3], ACTUATORS.name: [0, 1, 2, 3]}
    assert complete_pages(pending) == {}
    pending.add("autopilot", batch(ACTUATORS, range(4, 12), 12, 4), 0)
    assert complete_pages(pending) == {TRUTH.name: list(range(4, 10)), ACTUATORS.name: list(range(4, 10))}
    assert pending.written == 10


def test_service_without_messages_completes_ticks():
    pending = Pending(["plant", "trajectory"])
    pending.add("plant", batch(POSE, [0, 5], 7), 0)
    assert pending.waits_for() == "the messages of trajectory from tick 0 on"
    pending.add("trajectory", batch(POSE, [], 6), 0)
    assert complete_pages(pending) == {POSE.name: [0, 5]}


def test_recorder_ends_after_every_service():
    pending = Pending(["plant", "autopilot"])
    for name, topic in (("plant", TRUTH), ("autopilot", ACTUATORS)):
        pending.add(name, batch(topic, [0, 1], 2), 0)
    pending.add("plant", b"", 2)
    assert not pending.ended
    pending.add("autopilot", b"", 2)
    assert pending.ended
    assert complete_pages(pending) == {TRUTH.name: [0, 1], ACTUATORS.name: [0, 1]}


def test_lost_batch_is_error_with_service_name():
    pending = Pending(["plant", "autopilot"])
    pending.add("plant", batch(TRUTH, range(4), 4), 0)
    with pytest.raises(LockStepError, match="the messages of plant of the ticks 4 to 7 are lost"):
        pending.add("plant", batch(TRUTH, range(8, 12), 12, 8), 0)
    with pytest.raises(LockStepError, match="the messages of autopilot of the ticks 0 to 2 are lost"):
        pending.add("autopilot", b"", 3)


def test_repeated_packet_and_end_are_ignored():
    pending = Pending(["plant"])
    for _ in range(2):
        pending.add("plant", batch(TRUTH, range(4), 4), 0)
    for _ in range(2):
        pending.add("plant", b"", 4)
    assert pending.ended
    assert complete_pages(pending) == {TRUTH.name: [0, 1, 2, 3]}
