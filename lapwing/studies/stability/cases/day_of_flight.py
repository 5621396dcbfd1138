"""Case 17, at length: a day of simulated flight."""

import time

import numpy as np

from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.services.common import ports
from lapwing.services.process_table import create_all
from lapwing.services.scene_resolver import load, resolve
from lapwing.studies.stability.case_result import CaseResult, Curve, Plot, Row

HARD = "24 h of hover in one go: memory that grows, a flight that slows down"
LONG = True

HOURS = 24


def resident() -> float:
    """Return the memory use of this process [MB]."""
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * 4096 / 1e6


def growth(whole: bool, hours: int) -> tuple[list[float], list[float]]:
    """Return (memory [MB] after, processor time [s] of) each hour; `whole`: keep the full history of the truth."""
    setup = resolve(load("hover", ["run.duration=86400.0", "trajectory.phase.1.duration=86390.0"]))
    graph = BlockDiagram(setup, create_all(setup), 64, {ports.TRUTH} if whole else ())
    memory, seconds = [], []
    for hour in range(1, hours + 1):
        started = time.process_time()  # of this process alone: others may be busy
        graph.advance(min(hour * round(3600.0 / setup.interval), setup.last_tick + 1))
        seconds.append(time.process_time() - started)
        memory.append(resident())
    return memory, seconds


def append_time_ratio() -> float:
    """Return the time of the last 1000 appended rows over that of the first, minus one: the baseline."""
    history, seconds = np.zeros(0), []
    for _ in range(20):
        started = time.process_time()
        for _ in range(1000):
            history = np.append(history, np.zeros(13))
        seconds.append(time.process_time() - started)
    return seconds[-1] / seconds[0] - 1.0


def run() -> CaseResult:
    """Measure memory and speed, hour by hour."""
    memory, seconds = growth(False, HOURS)
    kept, _ = growth(True, 2)
    rows = [
        Row(
            "memory",
            "a ring of rows",
            "growth of the resident memory [MB] from the first hour to the last",
            10.0,
            "what Python's allocator may take now and then",
            memory[-1] - memory[0],
            "every row of the truth kept, of the second hour alone",
            kept[-1] - kept[0],
        ),
        Row(
            "speed",
            "the same compiled loop",
            "processor time of the last hours over that of the first, the fastest of three each, less one",
            0.05,
            "within 5 %, as the issue asks",
            min(seconds[-3:]) / min(seconds[:3]) - 1.0,
            "a history that is appended to, 20 000 rows",
            append_time_ratio(),
        ),
    ]
    hours = np.arange(1.0, HOURS + 1)
    return CaseResult(rows, Plot("hour", "processor time [s]", [Curve("hover", hours, np.array(seconds))], log_y=False))
