"""Step packets and log packets: layout, round trips, and rejection of invalid packets."""

from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lapwing.cosim.config.serialise import to_json
from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.cosim.diagram.tick_schedule import InputPort, Port
from lapwing.cosim.diagram.topic_encoder import RecordBatch
from lapwing.cosim.transport.packets import PacketError, StepPacketCodec, layout, pack_log_packet, unpack_log_packet
from lapwing.kernels.row_packing import pack_row
from lapwing.messages.message_diff import leaves
from lapwing.messages.topics import COMMAND_ACKS, OPERATOR, STATUS, TRUTH
from lapwing.services.common.ports import MotorCommand, StateEstimate
from lapwing.services.process_table import create_all
from lapwing.services.scene_resolver import load, resolve
from tests.cosim.small_graph import graph_of


class Pair(NamedTuple):
    """Port of two numbers."""

    left: float
    right: float


class Single(NamedTuple):
    """Port of a number and a Boolean."""

    number: float
    good: bool


PORTS = (Port("pair", Pair(0.0, 0.0)), Port("slow", Single(0.0, False), 5), Port("slower", Pair(0.0, 0.0), 10))


class User:
    """Service that uses some of the ports."""

    name = "user"
    outputs = ()

    def __init__(self, *names):
        self.inputs = tuple(InputPort(name) for name in names)

    def bind(self, diagram):
        """Do nothing."""


def diagram(*names):
    return graph_of(User(*names), ports=PORTS, kept_ticks=16)


def run_of(ticks):
    """Return a diagram with values of the due ports at each tick in [0, ticks)."""
    result = diagram("pair", "slow", "slower")
    for port in PORTS:
        for tick in range(0, ticks, port.period):
            result.put(port.name, tick, type(port.example)(tick + 0.5, True if port.name == "slow" else -float(tick)))
    return result


@pytest.mark.parametrize(("tick", "numbers"), [(0, 6), (3, 2), (5, 4), (10, 6)])
def test_step_packet_holds_due_rows_in_order(tick, numbers):
    codec, producer, consumer = StepPacketCodec(PORTS), run_of(tick + 1), diagram("slower", "pair", "slow")
    payload = codec.pack(producer, tick)
    expected = [tick + 0.5, -float(tick), tick + 0.5, 1.0, tick + 0.5, -float(tick)][:numbers]
    assert np.frombuffer(payload, "<f8").tolist() == expected
    codec.unpack(payload, consumer, tick)
    for port in PORTS:
        if tick % port.period == 0:
            assert consumer.latest(port.name, tick) == producer.latest(port.name, tick)


def test_diagram_stores_ports_in_use_only():
    consumer = diagram("slow")
    StepPacketCodec(PORTS).unpack(StepPacketCodec(PORTS).pack(run_of(11), 10), consumer, 10)
    assert consumer.latest("slow", 10) == Single(10.5, True)
    assert not consumer.has("pair")


def test_service_without_due_port_has_no_packet():
    assert [tick for tick in range(12) if StepPacketCodec(PORTS[1:]).due(tick)] == [0, 5, 10]
    assert all(StepPacketCodec(PORTS).due(tick) for tick in range(12))
    assert not StepPacketCodec(()).due(0)


@pytest.mark.parametrize("ticks", [2, 3, 4, 7, 12])
def test_packet_of_several_ticks_equals_single_packets(ticks):
    producer, one_by_one, at_once = run_of(15), diagram("pair", "slow"), diagram("pair", "slow")
    for ports in (PORTS, PORTS[1:]):
        single, several = StepPacketCodec(ports), StepPacketCodec(ports, ticks)
        for first in range(0, 15 - ticks, ticks):
            each = [tick for tick in range(first, first + ticks) if single.due(tick)]
            assert several.due(first) == bool(each)
            for tick in each:
                single.unpack(single.pack(producer, tick), one_by_one, tick)
            if each:
                payload = several.pack(producer, first)
                assert len(payload) == sum(len(single.pack(producer, tick)) for tick in each)
                several.unpack(payload, at_once, first)
        for port in ports[:-1]:
            for tick in range(0, first + ticks, port.period):
                assert at_once.row(port.name, tick).tolist() == one_by_one.row(port.name, tick).tolist()


@pytest.mark.parametrize("size", [0, 64, 72, 81])
def test_packet_of_several_ticks_with_wrong_size_is_rejected(size):
    with pytest.raises(PacketError, match=rf"^step packet of {size} bytes at tick 4, expected 80$"):
        StepPacketCodec(PORTS, 4).unpack(bytes(size), diagram("pair", "slow"), 4)


@pytest.mark.parametrize("size", [0, 8, 15, 17, 24, 40, 48])
def test_packet_with_wrong_size_is_rejected(size):
    with pytest.raises(PacketError, match=rf"^step packet of {size} bytes at tick 5, expected 32$"):
        StepPacketCodec(PORTS).unpack(bytes(size), diagram("pair", "slow"), 5)


def page(topic, first, n, size, seed=0):
    random = np.random.default_rng(seed)
    return RecordBatch(topic, np.arange(first, first + n), random.integers(0, 256, (n, size)).astype(np.uint8))


def records(n):
    """Return a batch whose payloads are records, as `TopicEncoder` makes them."""
    dtype = np.dtype({"names": ["x", "all"], "formats": ["<f8", "V12"], "offsets": [4, 0], "itemsize": 12})
    result = np.zeros(n, dtype)
    result["x"] = np.arange(n)
    return RecordBatch(STATUS, np.arange(0, 5 * n, 5), result)


def test_log_packet_round_trips():
    pages = [page(TRUTH, 7, 20, 256), page(OPERATOR, 9, 1, 3), records(4), page(COMMAND_ACKS, 10, 2, 0)]
    start, stop, result = unpack_log_packet(pack_log_packet(pages, 20, 27))
    assert (start, stop) == (20, 27)
    for before, after in zip(pages, result, strict=True):
        assert after.topic is before.topic
        assert after.ticks.tolist() == before.ticks.tolist()
        assert [p.tobytes() for p in after.payloads] == [p.tobytes() for p in before.payloads]


def test_empty_log_packet_has_ticks():
    assert unpack_log_packet(pack_log_packet([], 3, 5)) == (3, 5, [])


WHOLE = pack_log_packet([page(TRUTH, 7, 20, 256), page(OPERATOR, 9, 1, 3)], 0, 27)


@given(st.integers(0, len(WHOLE) - 1).filter(lambda n: n not in (16, 16 + 10 + 20 * (8 + 256))))
def test_truncated_log_packet_is_rejected(size):
    with pytest.raises(PacketError, match=rf"^log packet of {size} bytes: "):
        unpack_log_packet(WHOLE[:size])


def test_log_packet_with_unknown_topic_is_rejected():
    with pytest.raises(PacketError, match=r"^log packet of "):
        unpack_log_packet(WHOLE[:16] + b"\xff\xff" + WHOLE[18:])


def test_columns_have_order_of_row():
    example = MotorCommand((1.0, 2.0, 3.0, 4.0), True, (5.0, 6.0, 7.0, 8.0), (9.0, 10.0, 11.0))
    named = dict(leaves(example))
    assert list(named.values()) == pack_row(example).tolist()
    assert named["motor_voltage.2"] == 3.0
    assert named["armed"] == 1.0
    assert named["attitude_reference.0"] == 9.0
    names = [column for column, _ in leaves(StateEstimate())]
    assert names[3:7] == ["attitude.w", "attitude.x", "attitude.y", "attitude.z"]


@pytest.mark.long
def test_packet_length_equals_layout():
    config = resolve(load("hover"))
    reported = layout(config)
    assert reported["config"] == to_json(config)
    diagram = BlockDiagram(config, create_all(config), 64)
    diagram.advance(26)
    for name, service in reported["services"].items():
        for tick in (24, 25):
            expected = 8 * sum(len(p["columns"]) for p in service["ports"] if tick % p["period"] == 0)
            assert len(StepPacketCodec(config.services[name].ports).pack(diagram, tick)) == expected
