"""Block diagrams: Python blocks among compiled blocks, replaced blocks, record batches."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from lapwing.cosim.diagram.block_diagram import NEVER
from lapwing.cosim.diagram.compiled_block import Block
from lapwing.cosim.diagram.tick_schedule import LATCHED, InputPort, Port
from lapwing.cosim.diagram.topic_encoder import TopicEncoder
from lapwing.cosim.run_errors import LockStepError
from lapwing.kernels.cell import Cell
from lapwing.messages import Clock, Setpoint, header
from lapwing.messages.cdr_arrays import stamp_columns
from lapwing.messages.topics import CLOCK, COMMAND_ACKS, SETPOINT, TRAJECTORY
from tests.cosim.blocks.readings import EXAMPLE, Readings, expected
from tests.cosim.blocks.running_sum import Number, RunningSum
from tests.cosim.small_graph import graph_of

READINGS = Port("readings", EXAMPLE)
NUMBERS, TOTAL = Port("numbers", Number(0.0), LATCHED), Port("total", Number(0.0))


class Acting:
    """Python block that notes its ticks and computes its next tick by a rule."""

    def __init__(self, name, following=lambda tick: NEVER, outputs=(), does=lambda diagram, tick: None):
        self.name, self.outputs, self.ticks = name, outputs, []
        self._following, self._does = following, does

    def bind(self, diagram):
        self._diagram = diagram

    def on_tick(self, tick):
        self.ticks.append(tick)
        self._does(self._diagram, tick)
        return self._following(tick)


def readings(**signals):
    return Block("readings", Readings(2.0, **signals), Cell(0), (), (READINGS,))


def test_python_block_runs_at_requested_ticks():
    seldom, once, always = Acting("a", lambda t: t + 7), Acting("b"), Acting("c", lambda t: t)
    diagram = graph_of(seldom, readings(), once, always, kept_ticks=32)
    diagram.advance(3)
    diagram.advance(30)
    assert seldom.ticks == [0, 7, 14, 21, 28]
    assert once.ticks == [0]
    assert always.ticks == list(range(30))  # a past tick means the next one


def test_wake_up_reaches_later_python_blocks_at_same_tick():
    before, after, last = Acting("before"), Acting("after"), Acting("last", lambda t: t + 4)
    diagram = graph_of(before, readings(look_every=10), after, last, kept_ticks=32)
    diagram.advance(31)
    assert before.ticks == [0]
    assert after.ticks == [0, 10, 20, 30]
    assert last.ticks == [0, 4, 8, 10, 14, 18, 20, 24, 28, 30]


def test_python_block_runs_in_block_order():
    def number(diagram, tick):
        diagram.put("numbers", tick, Number(diagram.latest("readings", tick).number))

    acting = Acting("number", lambda t: t + 1, (NUMBERS,), number)
    total = Block("total", RunningSum(1.0), Cell(0.0), (InputPort("numbers"),), (TOTAL,))
    diagram = graph_of(readings(), acting, total, kept_ticks=32)
    diagram.advance(20)
    assert diagram.latest("total", 19).value == sum(2.0 * tick for tick in range(20))


def test_replacement_block_keeps_state():
    total = Block("total", RunningSum(1.0), Cell(0.0), (InputPort("numbers"),), (TOTAL,))

    def exchange(diagram, tick):
        if tick == 6:
            other = replace(diagram.block("total"), parameters=RunningSum(-1.0))
            diagram.replace(other, diagram.prepare(other))

    diagram = graph_of(Acting("exchange", lambda t: 6, (), exchange), total, ports=(NUMBERS,), kept_ticks=32)
    diagram.put("numbers", 0, Number(1.0))
    diagram.advance(16)
    assert [diagram.latest("total", tick).value for tick in (5, 6, 15)] == [6.0, 5.0, -4.0]
    assert diagram.block("total").parameters == RunningSum(-1.0)


def test_latest_between_samples_is_previous_sample():
    slow = Port("readings", EXAMPLE, 5)
    diagram = graph_of(Block("readings", Readings(2.0), Cell(0), (), (slow,), 5), kept_ticks=16)
    diagram.advance(13)
    assert diagram.latest("readings", 4) == expected(2.0, 0, 1)
    assert diagram.latest("readings", 12) == expected(2.0, 10, 3)


def test_port_without_producer_is_named():
    block = Block("total", RunningSum(1.0), Cell(0.0), (InputPort("wind"),), (TOTAL,))
    with pytest.raises(LockStepError, match=r"^no service of this scene publishes wind$"):
        graph_of(block)


def encoder(topic=SETPOINT, period=1):
    """Return an encoder whose phase text depends on `good` of the readings."""
    texts = ("climb", "on the way")
    return TopicEncoder(
        topic, "readings", period,
        lambda x, time_ns: {**stamp_columns(time_ns), "yaw": x.number},
        lambda good: Setpoint(header(0, "world"), phase=texts[good]),
        lambda x: [x.good],
    )  # fmt: skip


def messages(batches):
    """Return {topic name: [(tick, payload)]} in order."""
    result = {}
    for batch in batches:
        of_topic = result.setdefault(batch.topic.name, [])
        of_topic += [(int(t), p.tobytes()) for t, p in zip(batch.ticks, batch.payloads, strict=True)]
    return {name: sorted(of_topic) for name, of_topic in result.items()}


def test_record_batches_are_equal_for_any_length():
    def flown(stops):
        diagram = graph_of(readings(end=50), encoders=[encoder(), encoder(COMMAND_ACKS, 4)], kept_ticks=64)
        batches = []
        for stop in stops:
            first = diagram.tick
            diagram.advance(stop)
            batches += diagram.record_batches(first, diagram.tick)
        return messages(batches)

    whole = flown([64])
    assert [len(whole[topic.name]) for topic in (SETPOINT, COMMAND_ACKS)] == [51, 13]
    assert flown(range(1, 64)) == flown([7, 8, 30, 31, 60]) == flown([50, 51]) == whole
    for tick, payload in whole[SETPOINT.name]:
        message = Setpoint.decode(payload)
        assert message == Setpoint(
            header(10_000_000 * tick, "world"), yaw=2.0 * tick, phase="on the way" if tick % 5 == 0 else "climb"
        )


def test_unrecorded_topics_need_explicit_request():
    diagram = graph_of(readings(), encoders=[encoder(), encoder(TRAJECTORY)], kept_ticks=16)
    diagram.advance(4)
    assert [batch.topic for batch in diagram.record_batches(2, 4)] == [SETPOINT]
    assert {batch.topic for batch in diagram.record_batches(0, 4, [TRAJECTORY])} == {TRAJECTORY}


def test_python_messages_are_returned_once_within_ticks():
    def say(diagram, tick):
        diagram.services[0].messages.append((CLOCK, tick, Clock().encode()))
        diagram.services[0].messages.append((COMMAND_ACKS, tick, bytes(8 + tick)))

    diagram = graph_of(Acting("talker", lambda t: t + 2, (), say), kept_ticks=16)
    diagram.advance(8)
    assert list(messages(diagram.record_batches(0, 3, keep=True))) == [CLOCK.name, COMMAND_ACKS.name]
    assert [tick for tick, _ in messages(diagram.record_batches(0, 3))[CLOCK.name]] == [0, 2]
    assert [(tick, len(p)) for tick, p in messages(diagram.record_batches(3, 8))[COMMAND_ACKS.name]] == [
        (4, 12),
        (6, 14),
    ]
    assert diagram.record_batches(0, 8) == []


class Pair(NamedTuple):
    """Port of two numbers."""

    left: float
    right: float


def test_rows_may_be_put_and_read_as_numbers():
    port = Port("pair", Pair(0.0, 0.0), 2)
    user = Acting("user")
    user.inputs = (InputPort("pair", 6),)
    diagram = graph_of(user, ports=(port,))
    for tick in range(0, 8, 2):
        diagram.put_row("pair", tick, np.array([tick, -tick]))
    assert diagram.row("pair", 6).tolist() == [6.0, -6.0]
    assert diagram.rows("pair", np.array([2, 4])).tolist() == [[2.0, -2.0], [4.0, -4.0]]
    assert diagram.latest("pair", 5) == Pair(4.0, -4.0)
    assert diagram.has("pair")
    assert not diagram.has("wind")
