"""Python time of the services in a lock-step cycle: `benchmarks.lockstep` with a bus that does nothing.

    python -m benchmarks.lockstep_python [CYCLES]

Processor time of one thread, so that other work on the machine counts little.
"""

import sys
import time
from types import SimpleNamespace

from benchmarks.lockstep import NONE, PARTS, Constant
from lapwing.cosim.access.publisher_ids import PublisherIds
from lapwing.cosim.config.run_config import RunConfig, ServiceConfig
from lapwing.cosim.diagram.block_diagram import BlockDiagram, Service
from lapwing.cosim.transport.packet_exchange import PAGE, PacketSender, packet_receivers
from lapwing.services.plant.encoders import wires as plant_wires


class Idle:
    """A bus whose messages are there at once, as zeros, and go nowhere."""

    refused = 0

    def __init__(self):
        self.next = (0, b"")

    def inbox(self, key, sender):
        return SimpleNamespace(get=lambda timeout: self.next)

    def publisher(self, key, drops=False):
        return lambda payload, time_ns: None

    def has_subscribers(self, keys):
        return False


def prepare(bus, giver, tick, interval_ns):
    """Let the bundle be there that `giver` takes next, if it takes one up to this tick."""
    bus.next = (tick * interval_ns, bytes(giver._codec.size(tick)))


def own(name, cycles):
    """Seconds a cycle of (taking, stepping, publishing) in the service `name`."""
    services = {service: ServiceConfig(None, *parts) for service, parts in PARTS.items()}
    setup = RunConfig("benchmark", "", 1, 2 * cycles, 250, 4_000_000, "gauss_seidel", "drone1", services, {}, {})
    bus = Idle()
    process = SimpleNamespace(
        setup=setup, name=name, bus=bus, participants=PublisherIds("bench"), key_prefix="bench",
        report_rejected=lambda: None, key=lambda topic: topic.zenoh_key("drone1", "bench"), packs_ticks=True,
    )  # fmt: skip
    service = Service(name, [Constant(name, 2 * cycles)], plant_wires(setup, NONE) if name == "plant" else [])
    graph = BlockDiagram(setup, [service], 2 * PAGE)
    givers, outlets = packet_receivers(process, graph), PacketSender(process, service, graph)
    taken = [0.0, 0.0, 0.0]
    for tick in range(cycles):
        for giver in givers:
            prepare(bus, giver, giver._newest + 1, setup.interval_ns)
            began = time.thread_time()
            giver.receive(tick)
            taken[0] += time.thread_time() - began
        began = time.thread_time()
        graph.advance(tick + 1)
        stepped = time.thread_time()
        outlets.publish(tick, tick + 1)
        taken[1] += stepped - began
        taken[2] += time.thread_time() - stepped
    return [seconds / cycles for seconds in taken]


def main(cycles=4000):
    total = 0.0
    for name in PARTS:
        figures = [seconds * 1e6 for seconds in own(name, cycles)]
        total += sum(figures)
        print(f"{name:10}: take {figures[0]:5.1f} us  step {figures[1]:5.1f} us  publish {figures[2]:5.1f} us")
    print(f"all       : {total:5.1f} us a cycle")


if __name__ == "__main__":
    main(*[int(a) for a in sys.argv[1:]])
