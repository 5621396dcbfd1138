"""Long flight: growth of memory, open files, threads and log, and change of speed.

    python -m benchmarks.soak [--minutes M | --hours H]

The delivery mission, which hovers in random wind until it is ended, at full speed: M minutes of wall time with a
process for each service, or H simulated hours in one process.
"""

import os
import signal
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from statistics import mean
from typing import NamedTuple

from benchmarks._command import command_line
from benchmarks._targets import Row, show
from lapwing.cosim.log import LogReader
from lapwing.cosim.processes.interrupt import Interrupted
from lapwing.cosim.processes.run_monitor import MONITOR
from lapwing.runs.multi_process_run import fly_processes
from lapwing.runs.observer import Silent
from lapwing.runs.single_process_run import fly_single
from lapwing.services.process_main import ProcessSpec
from lapwing.services.scene_resolver import load, resolve

SCENE, HOVER = "delivery_mission", "trajectory.phase.2.duration=1e6"
LINES = 40  # number of samples of a run
TICKS = os.sysconf("SC_CLK_TCK")
PAGE_MB = os.sysconf("SC_PAGESIZE") / 1e6


class Sample(NamedTuple):
    """Sample of all processes of a run."""

    wall: float  # [s] since the first tick
    simulated: float  # [s] simulation time
    memory: float  # [MB] resident
    files: int  # number of open files
    threads: int
    processor: float  # [s] processor time
    log: float  # [MB] size of the log


class Sampler(Silent):
    """Observer that samples the flight and this process, and ends the flight after a wall time."""

    def __init__(self, log: Path, minutes: float = 0.0, hours: float = 0.0):
        """Prepare a flight of `minutes` of wall time, or of `hours` of simulation time."""
        self._log, self._minutes = log, minutes
        self._period = (60.0 * minutes or 3600.0 * hours) / LINES
        self._began, self._next = time.monotonic(), 0.0
        self.samples: list[Sample] = []

    def begin(self) -> None:
        """Print the header at the first tick."""
        self._began = time.monotonic()
        print(" ".join(f"{name:>10}" for name in Sample._fields), flush=True)

    def say(self, line: str) -> None:
        """Print a line."""
        print(line, flush=True)

    def show(self, time_ns: int, pose: bytes | None, status: bytes | None) -> None:
        """Take a sample if one is due at `time_ns`."""
        wall, simulated = time.monotonic() - self._began, time_ns * 1e-9
        if (wall if self._minutes else simulated) < self._next:
            return
        self._next += self._period
        self.samples.append(sample(wall, simulated, self._log))
        print(" ".join(f"{value:10.1f}" for value in self.samples[-1]), flush=True)
        if self._minutes and wall >= 60.0 * self._minutes:
            os.kill(os.getpid(), signal.SIGINT)


def sample(wall: float, simulated: float, log: Path) -> Sample:
    """Return a sample of this process and its children."""
    memory, files, threads, processor = 0.0, 0, 0, 0.0
    mine = Path(f"/proc/{os.getpid()}")
    children = (mine / "task" / mine.name / "children").read_text().split()
    for folder in (mine, *(Path("/proc", child) for child in children)):
        fields = (folder / "stat").read_text().rpartition(")")[2].split()  # from the third field of proc(5) on
        processor += (int(fields[11]) + int(fields[12])) / TICKS
        threads += int(fields[17])
        memory += int(fields[21]) * PAGE_MB
        files += len(list((folder / "fd").iterdir()))
    return Sample(wall, simulated, memory, files, threads, processor, log.stat().st_size / 1e6)


def rows(samples: list[Sample], name: str) -> list[Row]:
    """Return ratios of the last quarter of the samples to the second one, and to the first one for the speed.

    In the second quarter, everything that is loaded once is in memory.
    """
    quarter = len(samples) // 4
    first, early, late = samples[: quarter + 1], samples[quarter : 2 * quarter + 1], samples[-quarter - 1 :]

    def rate(some: list[Sample], field: str, reference: str) -> float:
        begin, end = some[0]._asdict(), some[-1]._asdict()
        return (end[field] - begin[field]) / (end[reference] - begin[reference])

    def growth(field: str) -> float:
        return mean(getattr(s, field) for s in late) / mean(getattr(s, field) for s in early)

    def ratio(field: str, reference: str, former: list[Sample]) -> float:
        return rate(late, field, reference) / rate(former, field, reference)

    speed, last = rate(samples, "simulated", "wall"), samples[-1]
    cost, size = rate(samples, "processor", "simulated"), rate(samples, "log", "simulated")
    print(f"{name}: {last.simulated:.0f} s in {last.wall:.0f} s, {speed:.1f} times real time; a simulated second takes")
    print(f"{1e3 * cost:.1f} ms of processor time and {1e3 * size:.0f} kB of log; last quarter over second:")
    return [
        Row(f"{name}: memory", growth("memory"), "", 1.02),
        Row(f"{name}: open files", growth("files"), "", 1.0),
        Row(f"{name}: threads", growth("threads"), "", 1.0),
        Row(f"{name}: processor time", ratio("processor", "simulated", early), "", 1.1),
        Row(f"{name}: log", ratio("log", "simulated", early), "", 1.02),
        Row(f"{name}: processor time, to the first", ratio("processor", "simulated", first), "", 1.1),
        Row(f"{name}: speed, to the first", ratio("simulated", "wall", first), "", 0.9, larger_is_better=True),
    ]


def processes(minutes: float, log: Path) -> list[Sample]:
    """Fly with a process for each service at full speed. Return the samples."""
    sampler = Sampler(log, minutes=minutes)
    config = resolve(load(SCENE, [HOVER, "run.duration=1e6"]))
    with suppress(Interrupted):
        fly_processes(ProcessSpec(MONITOR, config, {}, "soak", log=str(log)), sampler)
    return sampler.samples


def single(hours: float, log: Path) -> list[Sample]:
    """Fly with all services in this process. Return the samples."""
    sampler = Sampler(log, hours=hours)
    with suppress(Interrupted):
        fly_single(resolve(load(SCENE, [HOVER, f"run.duration={3600.0 * hours}"])), log, observer=sampler)
    return sampler.samples


def main(minutes: float = 2.0, hours: float = 0.0) -> list[Row]:
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder, "log.mcap")
        samples = single(hours, log) if hours else processes(minutes, log)
        simulated = samples[-1].simulated
        with LogReader(log) as read:
            last = max(time_ns for _, _, time_ns, _ in read.messages(start_ns=int(1e9 * (simulated - 10.0)))) * 1e-9
        print(f"log complete: {read.complete}, to {last:.1f} s")
    result = rows(samples, "soak, one process" if hours else "soak, processes")
    return show(result)


if __name__ == "__main__":
    command_line(main)
