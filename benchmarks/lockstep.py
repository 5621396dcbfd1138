"""Lock step of four processes against the bare three-hop Zenoh ping, interleaved in one run.

    python -m benchmarks.lockstep [CYCLES] [REPEATS]

The ping: three processes hand 200 bytes round in a circle over the same Zenoh configuration, nothing else. The lock
step: plant, sensors, autopilot and trajectory with messages of real size (encoded, stamped, attached, decoded), but no
physics and no recorder, so that what is compared is the exchange.
"""

import json
import queue
import subprocess
import sys
import time
from itertools import pairwise
from statistics import median

from messages import Actuators, Clock, Imu, Setpoint, VehicleState, header, stamp
from messages.topics import ACTUATORS, CLOCK, IMU, SETPOINT, TRUTH
from services.bus import ZenohBus, mesh
from services.launcher import loopback_endpoints
from services.lockstep import Input
from services.process import Process, pin, run_lockstep
from services.sections import Exchange, Rates, Vehicle

INTERVAL = 4_000_000
FOUR = (1.0, 2.0, 3.0, 4.0)
HOPS = 3


class Plant:
    inputs, outputs = (Input(ACTUATORS, 1),), (TRUTH, CLOCK)

    def __init__(self, cycles):
        self.finished, self.cycles, self.stamps = False, cycles, []

    def step(self, tick, actuators):
        self.stamps.append(time.perf_counter())
        self.finished = tick == self.cycles
        yield (
            TRUTH,
            VehicleState(
                header(tick * INTERVAL, "world"),
                rotor_speed=FOUR,
                motor_voltage=FOUR,
                motor_current=FOUR,
                motor_power=FOUR,
                rotor_thrust=FOUR,
                rotor_torque=FOUR,
            ),
        )
        if tick % 5 == 0:
            yield CLOCK, Clock(stamp(tick * INTERVAL))


class Sensors:
    inputs, outputs = (Input(TRUTH),), (IMU,)

    def step(self, tick, truth):
        yield IMU, Imu(header(tick * INTERVAL, "body"))


class Autopilot:
    inputs, outputs = (Input(IMU), Input(SETPOINT)), (ACTUATORS,)

    def step(self, tick, imu, setpoint):
        yield ACTUATORS, Actuators(header(tick * INTERVAL, "body"), motor_voltage=FOUR, armed=True)


class Trajectory:
    inputs, outputs = (Input(CLOCK, 25),), (SETPOINT,)

    def step(self, tick, clock):
        yield SETPOINT, Setpoint(header(tick * INTERVAL, "world"), phase="climb")


SERVICES = {"plant": Plant, "sensors": Sensors, "autopilot": Autopilot, "trajectory": Trajectory}


class Scene:
    """Just what the shell asks of a scene."""

    tables = {  # noqa: RUF012
        Exchange: Exchange(),
        Rates: Rates(),
        Vehicle: Vehicle(),
    }

    def __getitem__(self, section):
        return self.tables[section]

    def lookup(self, dotted):
        return getattr(self.tables[Rates], dotted.rpartition(".")[2], 250)

    def period(self, rate, key):
        return 250 // rate


def lockstep_process(name, peers, cycles, core):
    service = SERVICES[name](cycles) if name == "plant" else SERVICES[name]()
    with ZenohBus(*mesh(name, peers)) as bus:
        run_lockstep(Process(name, Scene(), bus, "bench", list(peers), core=core), service)
        if name == "plant":
            print(json.dumps(service.stamps), flush=True)


def ping_process(name, peers, cycles, core):
    names = list(peers)
    following = names[(names.index(name) + 1) % len(names)]
    with ZenohBus(*mesh(name, peers)) as bus:
        zenoh = sys.modules["zenoh"]
        session, arrived = bus._session, queue.SimpleQueue()
        handler = zenoh.handlers.Callback(arrived.put, indirect=False)
        subscriber = session.declare_subscriber(f"ping/{name}", handler)
        publisher = session.declare_publisher(f"ping/{following}", congestion_control=zenoh.CongestionControl.BLOCK)
        bus.declare_alive(f"ping/_alive/{name}")
        missing = bus.wait_alive([f"ping/_alive/{n}" for n in names], 30.0)
        assert not missing
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


KINDS = {"ping": (ping_process, ["a", "b", "c"]), "lockstep": (lockstep_process, list(SERVICES))}


def measure(kind, cycles, core):
    """Seconds of each cycle."""
    peers = loopback_endpoints(KINDS[kind][1])
    children = [
        subprocess.Popen(
            [sys.executable, "-m", "benchmarks.lockstep", kind, name, json.dumps(peers), str(cycles), json.dumps(core)],
            stdout=subprocess.PIPE,
            text=True,
        )
        for name in peers
    ]
    output = "".join(child.communicate(timeout=120)[0] for child in children)
    stamps = json.loads(output)
    cycles_s = [b - a for a, b in pairwise(stamps)]
    return cycles_s[len(cycles_s) // 10 :]  # without the start


def percentile(values, share):
    return sorted(values)[int(share * (len(values) - 1))]


def compare(cycles, repeats, core):
    """Medians over interleaved repeats."""
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


def main(cycles=5000, repeats=5):
    for placing, core in (("one core", 0), ("free", None)):
        figures = compare(cycles, repeats, core)
        for kind in KINDS:
            f = figures[kind]
            print(
                f"{kind:8} ({placing:8}): p50 {f['p50_us']:6.1f} us  p99 {f['p99_us']:6.1f} us  "
                f"{f['cycles_per_s']:6.0f} cycles/s  {HOPS} hops"
            )
        print(f"lockstep / ping ({placing}): {figures['ratio_of_medians']:.2f}")


if __name__ == "__main__":
    if len(sys.argv) > 3:
        KINDS[sys.argv[1]][0](sys.argv[2], json.loads(sys.argv[3]), int(sys.argv[4]), json.loads(sys.argv[5]))
    else:
        main(*[int(a) for a in sys.argv[1:]])
