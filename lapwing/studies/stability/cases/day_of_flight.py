"""Case 17, long variant: a day of simulated flight."""

import time

import numpy as np

from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.services.common import ports
from lapwing.services.process_table import create_all
from lapwing.services.scene_resolver import load, resolve
from lapwing.studies.stability.case_result import CaseResult, Curve, Plot, Row

HARD = "24 h of hover in one run: memory must not grow, the flight must not slow down"
LONG = True

HOURS = 24


def resident() -> float:
    """Return the memory use of this process [MB]."""
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * 4096 / 1e6


def growth(record_truth: bool, hours: int) -> tuple[list[float], list[float]]:
    """Return (memory [MB] after each hour, processor time [s] of each hour).

    `record_truth` keeps the full history of the ground truth.
    """
    config = resolve(load("hover", ["run.duration=86400.0", "trajectory.phase.1.duration=86390.0"]))
    diagram = BlockDiagram(config, create_all(config), 64, {ports.TRUTH} if record_truth else ())
    memory, seconds = [], []
    for hour in range(1, hours + 1):
        started = time.process_time()  # of this process alone
        diagram.advance(min(hour * round(3600.0 / config.interval), config.last_tick + 1))
        seconds.append(time.process_time() - started)
        memory.append(resident())
    return memory, seconds


def append_time_ratio() -> float:
    """Return the time to append the last 1000 rows over that of the first 1000, minus one (baseline)."""
    history, seconds = np.zeros(0), []
    for _ in range(20):
        started = time.process_time()
        for _ in range(1000):
            history = np.append(history, np.zeros(13))
        seconds.append(time.process_time() - started)
    return seconds[-1] / seconds[0] - 1.0


def run() -> CaseResult:
    """Measure memory and processor time of each hour."""
    memory, seconds = growth(False, HOURS)
    full_history, _ = growth(True, 2)
    rows = [
        Row("memory", "ring buffers of samples", "growth of the resident memory [MB] from the first hour to the last",
            10.0, "occasional growth of Python's heap", memory[-1] - memory[0],
            "full history of the ground truth, second hour only", full_history[-1] - full_history[0]),
        Row("speed", "compiled loop",
            "processor time of the last hours over that of the first ones, fastest of three each, minus one", 0.05,
            "variation of the processor time between hours", min(seconds[-3:]) / min(seconds[:3]) - 1.0,
            "an array that grows by each sample, 20 000 rows", append_time_ratio()),
    ]  # fmt: skip
    hours = np.arange(1.0, HOURS + 1)
    return CaseResult(rows, Plot("hour", "processor time [s]", [Curve("hover", hours, np.array(seconds))], log_y=False))
