"""The mission in a loop at speed 1 with a ground station: memory, files and threads must not grow.

    python -m tests.faults.soak --hours 24 [--scene delivery_mission]

Each flight is the real command in several processes. Prints a line per flight: the largest sum over its processes of
resident memory, open files and threads, the lag of the telemetry, and the memory of the ground station. Exit code 1 if
a flight fails, leaves something behind or has a log that does not resimulate to its digest (heartbeats of the station
arrive at other ticks in each flight), or if a median of the last third of the flights exceeds that of the first third
by more than 5 %.
"""

import argparse
import os
import re
import resource
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from statistics import median
from typing import NamedTuple

from pymavlink import mavutil

from tests.commands import run_command
from tests.faults import leak_checks

PAGE = resource.getpagesize()  # [B]
SPARE = 0.05  # growth of a median that counts as flat
BEHIND = re.compile(r"at most (\d+) ms behind")


class Use(NamedTuple):
    """Resources of a flight, the largest sums over its processes, and of the ground station."""

    memory: int  # [B] resident
    files: int
    threads: int
    station: int = 0  # [B] resident memory of the ground station

    @classmethod
    def of(cls, processes: Iterable[int]) -> "Use":
        """Return the present sums over processes."""
        memory = files = threads = 0
        for process in processes:
            with suppress(OSError):
                memory += PAGE * int(Path(f"/proc/{process}/statm").read_text().split()[1])
                threads += len(os.listdir(f"/proc/{process}/task"))
                files += len(os.listdir(f"/proc/{process}/fd"))
        return cls(memory, files, threads)


class Flight(NamedTuple):
    """Result of a flight."""

    use: Use
    behind: int  # [ms] largest lag of the telemetry
    messages: int  # that the ground station received
    wrong: list[str]


@contextmanager
def ground_station() -> Iterator[tuple[str, list[int]]]:
    """Yield the endpoint of a ground station that sends heartbeats, and its growing count of received messages."""
    link = mavutil.mavlink_connection("udpin:127.0.0.1:0", source_system=255)
    count, stop = [0], threading.Event()

    def receive() -> None:
        sent = 0.0
        while not stop.is_set():
            if link.recv_match(blocking=True, timeout=0.2) is not None:
                count[0] += 1
            if link.target_system and time.monotonic() - sent > 1.0:
                link.mav.heartbeat_send(mavutil.mavlink.MAV_TYPE_GCS, mavutil.mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 0)
                sent = time.monotonic()

    thread = threading.Thread(target=receive, daemon=True)
    thread.start()
    try:
        yield f"udpout:127.0.0.1:{link.port.getsockname()[1]}", count
    finally:
        stop.set()
        thread.join()
        link.close()


def fly(scene: list[str], endpoint: str, count: list[int]) -> Flight:
    """Fly once at speed 1 and watch the resources of all processes."""
    before = count[0]
    with tempfile.TemporaryDirectory(prefix="soak-") as name:
        folder = Path(name)
        log = str(folder / "log.mcap")
        command = [sys.executable, "-m", "lapwing", "run", *scene, "--speed", "1", "--mavlink", endpoint, "--log", log]
        with open(folder / "text", "w+", encoding="utf-8") as text:
            flight = subprocess.Popen(command, stdout=text, stderr=text)
            use, taken = Use(0, 0, 0), {}
            while flight.poll() is None:
                processes = leak_checks.of_trial(folder)
                taken |= leak_checks.ports(processes)
                use = Use(*map(max, use, Use.of(processes)))
                time.sleep(1.0)
            text.seek(0)
            report = text.read()
        use = use._replace(station=Use.of([os.getpid()]).memory)
        wrong = leak_checks.left(folder, taken, None, 10.0)
        if flight.returncode:
            return Flight(use, 0, 0, [*wrong, f"exit code {flight.returncode}: {report[-300:]}"])
        done = run_command("resimulate", log)
        wrong += [f"resimulate: {done.stderr[-300:]}"] if done.returncode else []
        lag = BEHIND.search(report)
        wrong += [] if lag else ["no report of the telemetry"]
        return Flight(use, int(lag[1]) if lag else 0, count[0] - before, wrong)


def grown(uses: list[Use]) -> list[str]:
    """Return the resources whose median over the last third exceeds that over the first third by more than `SPARE`."""
    third = max(len(uses) // 3, 1)
    result = []
    for name in Use._fields:
        first, last = (median(getattr(use, name) for use in part) for part in (uses[:third], uses[-third:]))
        if last > (1.0 + SPARE) * first:
            result.append(f"{name} has grown from {first:g} to {last:g}")
    return result


def soak(scene: list[str], seconds: float) -> Iterator[Flight]:
    """Yield flights one after another; start none after `seconds`."""
    until = time.monotonic() + seconds
    with ground_station() as (endpoint, count):
        while time.monotonic() < until:
            yield fly(scene, endpoint, count)


def main() -> None:
    """Run the flights and print a line each."""
    parser = argparse.ArgumentParser(description="The mission in a loop at speed 1 with a ground station.")
    parser.add_argument("--hours", type=float, default=24.0)
    parser.add_argument("--scene", default="delivery_mission")
    values = parser.parse_args()
    flights: list[Flight] = []
    wrong = False
    for flight in soak([values.scene], 3600.0 * values.hours):
        flights.append(flight)
        wrong |= bool(flight.wrong)
        use = flight.use
        print(
            f"{time.strftime('%H:%M:%S')} flight {len(flights)}: {use.memory / 2**20:.0f} MB, {use.files} files, "
            f"{use.threads} threads, {flight.messages} messages, {flight.behind} ms behind; ground station "
            f"{use.station / 2**20:.0f} MB{''.join(f'; {fault}' for fault in flight.wrong)}",
            flush=True,
        )
    growth = grown([flight.use for flight in flights])
    print("; ".join(growth) or f"{len(flights)} flights: memory, files and threads are flat")
    raise SystemExit(wrong or bool(growth))


if __name__ == "__main__":
    main()
