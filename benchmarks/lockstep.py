"""Lock step of four processes against the bare three-hop Zenoh ping, interleaved in one run.

    python -m benchmarks.lockstep [--cycles N] [--repeats N]

Ping: three processes pass 200 bytes in a circle over the same Zenoh configuration. Lock step: plant, sensors, autopilot
and trajectory with step packets of real size and log packets of the plant, but without physics and recorder, so that
only the exchange is compared.
"""

import json
import queue
import subprocess
import sys
import time
from itertools import pairwise
from statistics import median

from benchmarks._command import command_line
from benchmarks._targets import Row, percentile, show
from lapwing.cosim.access.private_sockets import private_endpoints
from lapwing.cosim.access.publisher_ids import PublisherIds
from lapwing.cosim.config.run_config import RunConfig, ServiceConfig
from lapwing.cosim.diagram.block_diagram import Service
from lapwing.cosim.diagram.tick_schedule import InputPort, Port
from lapwing.cosim.executors.lockstep import pin, run_lockstep
from lapwing.cosim.executors.participant import Participant
from lapwing.cosim.transport.bus import ZenohBus
from lapwing.cosim.transport.session_settings import mesh
from lapwing.kernels.row_packing import pack_row
from lapwing.services.common import ports
from lapwing.services.common.ports import MotorCommand, Setpoint, TrueState
from lapwing.services.plant.encoders import PlantEncoding, topic_encoders
from lapwing.services.trajectory.resolve import LEAD

HOPS = 3
NONE = PlantEncoding(5, False, 0, 0.0, ())
PARTS = {  # inputs and ports of the mission's services
    "plant": (
        (InputPort(ports.ACTUATORS, 1),),
        (Port(ports.TRUTH, TrueState(*[(1.0,) * 4 if v == () else v for v in TrueState()])),),
    ),
    "sensors": ((InputPort(ports.TRUTH),), (Port(ports.IMU, ports.ImuReading()),)),
    "autopilot": (
        (InputPort(ports.IMU), InputPort(ports.TRAJECTORY)),
        (Port(ports.ACTUATORS, MotorCommand((1.0,) * 4, True, (1.0,) * 4, (0.0,) * 3)),),
    ),
    "trajectory": ((InputPort(ports.TRUTH, round(250 * LEAD)),), (Port(ports.TRAJECTORY, Setpoint()),)),
}


class Constant:
    """Block that publishes the same values at every tick; that of the plant records the time and ends the run."""

    def __init__(self, name, cycles):
        self.name, self.inputs, self.outputs = name, *PARTS[name]
        self.rows = [(port.name, pack_row(port.example)) for port in self.outputs]
        self.cycles, self.stamps = cycles, []

    def bind(self, diagram):
        self.diagram = diagram

    def on_tick(self, tick):
        for name, row in self.rows:
            self.diagram.put_row(name, tick, row)
        if self.name == "plant":
            self.stamps.append(time.perf_counter())
            if tick == self.cycles:
                self.diagram.finish()
        return tick + 1


def lockstep_process(name, peers, cycles, core):
    services = {name: ServiceConfig(None, *parts) for name, parts in PARTS.items()}
    config = RunConfig("benchmark", "", 1, cycles, 250, 4_000_000, "gauss_seidel", "drone1", services, {}, {})
    part = Constant(name, cycles)
    encoders = topic_encoders(config, NONE) if name == "plant" else []
    participants = PublisherIds("bench")
    with ZenohBus(*mesh(name, peers), gid=participants.gid(name)) as bus:
        run_lockstep(
            Participant(name, config, bus, participants, list(peers), core=core),
            Service(name, [part], encoders),
            name == "plant",
            "recorder",
        )
        if name == "plant":
            print(json.dumps(part.stamps), flush=True)


def ping_process(name, peers, cycles, core):
    names = list(peers)
    following = names[(names.index(name) + 1) % len(names)]
    with ZenohBus(*mesh(name, peers)) as bus:
        zenoh = sys.modules["zenoh"]
        session, arrived = bus._session, queue.SimpleQueue()
        handler = zenoh.handlers.Callback(arrived.put, indirect=False)
        subscriber = session.declare_subscriber(f"ping/{name}", handler)
        publisher = session.declare_publisher(f"ping/{following}", congestion_control=zenoh.CongestionControl.BLOCK)
        bus.declare_liveliness(f"ping/_alive/{name}")
        present: set[str] = set()
        bus.watch_liveliness("ping/_alive/*", lambda key, alive: present.add(key))
        while len(present) < len(names):
            time.sleep(0.01)
        if core is not None:
            pin(core)
        payload, stamps = bytes(200), []
        for _ in range(cycles):
            if name == names[0]:
                stamps.append(time.perf_counter())
                publisher.put(payload)
                arrived.get(timeout=10).payload.to_bytes()
            else:
                publisher.put(arrived.get(timeout=10).payload.to_bytes())
        time.sleep(0.2)
        subscriber.undeclare()
        if stamps:
            print(json.dumps(stamps), flush=True)


KINDS = {"ping": (ping_process, ["a", "b", "c"]), "lockstep": (lockstep_process, list(PARTS))}


def measure(kind, cycles, core):
    """Return the duration [s] of each cycle."""
    with private_endpoints(KINDS[kind][1]) as peers:
        begin, end = f"from benchmarks.lockstep import KINDS; KINDS[{kind!r}][0](", f", {peers!r}, {cycles}, {core})"
        children = [
            subprocess.Popen([sys.executable, "-c", f"{begin}{name!r}{end}"], stdout=subprocess.PIPE, text=True)
            for name in peers
        ]
        output = "".join(child.communicate(timeout=120)[0] for child in children)
    stamps = json.loads(output)
    cycles_s = [b - a for a, b in pairwise(stamps)]
    return cycles_s[len(cycles_s) // 10 :]  # without the start-up


def compare(cycles, repeats, core):
    """Return medians over interleaved repeats."""
    figures = {kind: [] for kind in KINDS}
    for _ in range(repeats):
        for kind in KINDS:
            times = measure(kind, cycles, core)
            figures[kind].append((percentile(times, 0.5), percentile(times, 0.99), sum(times) / len(times)))
    result = {}
    for kind, rows in figures.items():
        p50, p99, mean = (median(column) for column in zip(*rows, strict=True))
        result[kind] = {"p50_us": p50 * 1e6, "p99_us": p99 * 1e6, "mean_us": mean * 1e6, "cycles_per_s": 1.0 / mean}
    ratios = [b[0] / a[0] for a, b in zip(figures["ping"], figures["lockstep"], strict=True)]
    result["ratio_of_medians"] = median(ratios)
    return result


def main(cycles: int = 5000, repeats: int = 5) -> list[Row]:
    result = []
    for placing, core in (("one core", 0), ("free", None)):
        figures = compare(cycles, repeats, core)
        for kind in KINDS:
            f = figures[kind]
            print(
                f"{kind:8} ({placing:8}): p50 {f['p50_us']:6.1f} us  p99 {f['p99_us']:6.1f} us  "
                f"{f['cycles_per_s']:6.0f} cycles/s  {HOPS} hops"
            )
        result.append(Row(f"cycle of the lock step to the bare ping, {placing}", figures["ratio_of_medians"], "", 1.5))
    return show(result)


if __name__ == "__main__":
    command_line(main)
