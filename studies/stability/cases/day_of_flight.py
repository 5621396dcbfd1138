"""Case 17, at length: a day of simulated flight."""

import time

import numpy as np

from cosim.graph import Graph
from services.common import ports
from services.processes import create_all
from services.table import load, resolve
from studies.stability.case import Curve, Found, Plot, Row

HARD = (
    "24 h of hover in one go: memory that grows, a flight that slows down, a clock that drifts, an attitude that decays"
)
LONG = True

HOURS = 24


def resident() -> float:
    """Memory of this process [MB]."""
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * 4096 / 1e6


def run() -> Found:
    """Memory, speed and attitude, hour by hour; the log's rows kept whole are the naive way."""
    setup = resolve(load("hover", ["run.duration=86400.0", "trajectory.phase.1.duration=86390.0"]))
    graph = Graph(setup, create_all(setup), 64)
    per_hour, memory, seconds, unit = round(3600.0 / setup.interval), [], [], []
    for hour in range(1, HOURS + 1):
        started = time.process_time()  # of this process alone: others may be busy
        graph.advance(min(hour * per_hour, setup.last_tick + 1))
        seconds.append(time.process_time() - started)
        memory.append(resident())
        told = graph.latest(ports.TRUTH, graph.tick - 1)
        unit.append(abs(float(np.linalg.norm(told.attitude)) - 1.0))
    kept = setup.ports[ports.TRUTH]
    grown = len(np.ravel(graph.row(kept.name, graph.tick - 1))) * 8e-6 * (HOURS - 1) * per_hour
    rows = [
        Row("memory", "a ring of rows", "growth of the resident memory [MB] from the first hour to the last", 10.0,
            "what Python's allocator may take now and then", memory[-1] - memory[0],
            "every row of the truth kept", grown),
        Row("attitude", "quaternion, polished at every step", "length of the quaternion less one", 1e-14,
            "round-off, which must not add up over 86 million steps", max(unit), "2e-16 a step, of one sign", 86.4e6 * 2e-16),
    ]  # fmt: skip
    slower = seconds[-1] / seconds[0] - 1.0
    rows.append(
        Row("speed", "the same compiled loop", "processor time of the last hour over that of the first, less one", 0.05,
            "as the tracker asks", slower, "rows in a list that is searched: twice as long for twice as many", HOURS - 1.0)
    )  # fmt: skip
    hours = np.arange(1.0, HOURS + 1)
    return Found(rows, Plot("hour", "processor time [s]", [Curve("hover", hours, np.array(seconds))], log_y=False))
