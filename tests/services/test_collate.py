"""The log's order does not depend on the order of arrival."""

import random
from pathlib import Path

import pytest

from messages.topics import ACTUATORS, IMU, POSE, SETPOINT, STATUS, TRUTH, WALL_TIME
from services.recorder.collate import Collator
from services.scene import load
from services.sections import period

SCENE = load(Path("scenes/delivery_mission.toml"))
TOPICS = {TRUTH, POSE, IMU, SETPOINT, ACTUATORS, STATUS}  # periods 1, 5, 1, 1, 1, 25
TICKS = 60


def streams():
    """By producer, what it publishes, in its order: (topic, tick, payload)."""
    producers = ([TRUTH, POSE], [IMU], [SETPOINT, STATUS], [ACTUATORS])
    return [
        [(t, k, f"{t.name}{k}".encode()) for k in range(TICKS) for t in topics if k % period(SCENE, t) == 0]
        for topics in producers
    ]


def interleaved(seed):
    """All messages in a random order that keeps each producer's own."""
    rng = random.Random(seed)
    waiting = [list(reversed(stream)) for stream in streams()]
    while any(waiting):
        yield rng.choice([stream for stream in waiting if stream]).pop()


def collated(messages):
    collator, out = Collator(SCENE, TOPICS), []
    for message in messages:
        collator.add(*message)
        out += collator.complete()
    return out


@pytest.mark.parametrize("seed", range(20))
def test_any_interleaving_gives_the_same_order(seed):
    out = collated(interleaved(seed))
    assert out == collated(message for stream in streams() for message in stream)
    assert [tick for tick, _ in out] == list(range(TICKS))


def test_within_a_tick_the_topic_table_gives_the_order():
    _, messages = collated(interleaved(1))[0]
    assert [topic for topic, _ in messages] == [TRUTH, POSE, IMU, SETPOINT, ACTUATORS, STATUS]


def test_a_tick_is_held_back_until_its_last_message():
    collator = Collator(SCENE, {TRUTH, ACTUATORS})
    collator.add(TRUTH, 0, b"a")
    collator.add(TRUTH, 1, b"b")
    assert list(collator.complete()) == []
    assert collator.waits_for() == "{vehicle}/actuators of tick 0"
    collator.add(ACTUATORS, 0, b"c")
    assert list(collator.complete()) == [(0, [(TRUTH, b"a"), (ACTUATORS, b"c")])]
    assert list(collator.complete()) == []


def test_what_nobody_publishes_in_lock_step_is_passed_over():
    collator = Collator(SCENE, {TRUTH})
    collator.add(WALL_TIME, 0, b"x")
    assert list(collator.complete()) == []
    assert collator.waits_for() == "the first message"
