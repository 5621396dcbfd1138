"""Outputs of a service arrive at its consumers for all periods and delays."""

from collections import defaultdict, deque
from types import SimpleNamespace

from hypothesis import example, given
from hypothesis import strategies as st

from lapwing.cosim.access.publisher_ids import PublisherIds
from lapwing.cosim.config.run_config import RunConfig, ServiceConfig
from lapwing.cosim.diagram.block_diagram import BlockDiagram, Service
from lapwing.cosim.diagram.tick_schedule import InputPort, Port, due
from lapwing.cosim.transport.packet_exchange import PacketSender, packet_receivers
from lapwing.kernels import python_function

LAST = 120  # [tick]
PERIODS = (1, 2, 5, 25, 4)
NAMES = tuple(f"port{i}" for i in range(len(PERIODS)))

due = python_function(due)


class Bus:
    """Messages by key, in order."""

    refused = 0

    def __init__(self):
        self.messages = defaultdict(deque)

    def publisher(self, key, drops=False):
        return lambda payload, time_ns: self.messages[key].append((time_ns, payload))

    def inbox(self, key, sender):
        return SimpleNamespace(get=lambda timeout: self.messages[key].popleft())

    def has_subscribers(self, keys):
        return False


class Counts:
    """Python block that writes the tick to each due port."""

    name, inputs = "counts", ()

    def __init__(self, outputs):
        self.outputs = outputs

    def bind(self, diagram):
        self.diagram = diagram

    def on_tick(self, tick):
        for port in self.outputs:
            if due(tick, port.period, 0) >= 0:
                self.diagram.put(port.name, tick, float(tick))
        return tick + 1


class Takes(Counts):
    """Python block that notes its inputs."""

    name, outputs = "takes", ()

    def __init__(self, inputs):
        self.inputs, self.noted = inputs, []

    def on_tick(self, tick):
        for i in self.inputs:
            stamp = due(tick, PERIODS[NAMES.index(i.port)], i.delay)
            if stamp >= 0:
                self.noted.append((i.port, stamp, self.diagram.latest(i.port, stamp)))
        return tick + 1


def exchanged(inputs):
    """Return the samples received by the consumer, and the number of packets by key."""
    ports = tuple(Port(name, 0.0, period) for name, period in zip(NAMES, PERIODS, strict=True))
    services = {"giver": ServiceConfig(None, (), ports), "taker": ServiceConfig(None, inputs, ())}
    config = RunConfig("", "", 1, LAST, 250, 4_000_000, "gauss_seidel", "drone1", services, {}, {})
    bus = Bus()

    def process(name):
        return SimpleNamespace(
            config=config, name=name, bus=bus, participants=PublisherIds("test"), key_prefix="test",
            report_rejected=lambda: None, key=str, packs_ticks=True, abandoned="",
        )  # fmt: skip

    giver, taker = Service("giver", [Counts(ports)], []), Service("taker", [Takes(inputs)], [])
    given_rows, taken_rows = BlockDiagram(config, [giver], 2048), BlockDiagram(config, [taker], 2048)
    outlets, (source,) = (
        PacketSender(process("giver"), giver, given_rows),
        packet_receivers(process("taker"), taken_rows),
    )
    for tick in range(LAST + 1):
        given_rows.advance(tick + 1)
        outlets.publish(tick, tick + 1)
    counts = {key: len(result) for key, result in bus.messages.items() if "_step" in key}
    outlets.end(LAST + 1)
    tick = 0
    while tick <= LAST:
        known = source.receive(tick)
        assert known > tick
        taken_rows.advance(min(known, LAST + 1))
        tick = known
    return taker.blocks[0].noted, counts


@given(st.dictionaries(st.sampled_from(NAMES), st.integers(0, 30), min_size=1))
@example({"port3": 0})
@example({"port2": 7, "port3": 0})
def test_rows_arrive_at_their_due_tick(delays):
    noted, _ = exchanged(tuple(InputPort(port, delay) for port, delay in delays.items()))
    assert noted
    assert all(value == stamp for _, stamp, value in noted)


def test_packet_period_is_gcd_of_consumed_port_periods():
    assert exchanged((InputPort("port3"),))[1] == {"test/_step_every_25/giver": 5}
    assert exchanged((InputPort("port3"), InputPort("port2")))[1] == {"test/_step_every_5/giver": 25}
    assert exchanged((InputPort("port3"), InputPort("port4")))[1] == {"test/_step/giver": LAST + 1}
