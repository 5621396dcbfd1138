"""MAVLink link: cost, jitter of the telemetry, and influence on the lock step.

    python -m benchmarks.mavlink [--soak]

Start: from the command to the first heartbeat and the first position, with cached kernels. Processor time: an
adapter with one client at PX4's rates in real time, fed by a run. Jitter: of ATTITUDE at 50 Hz as a
client on UDP sees it, in a run at real time. Lock step: the same scene at top speed without an operator, with a silent
operator, and with a link; the best of alternating repeats. The soak: a client flies 30 simulated minutes at ten times
real time, and counts heartbeats.
"""

import json
import socket
import subprocess
import sys
import tempfile
import time
from itertools import pairwise
from pathlib import Path
from statistics import median

from pymavlink import mavutil

from benchmarks._command import command_line
from benchmarks._targets import Row, percentile, show
from tests.participants import participants

MISSION, GROUND = "lapwing/scenes/delivery_mission.toml", "lapwing/scenes/groundstation.toml"
SECONDS = 30.0  # [s] of real time for jitter and processor time
REPEATS = 5
SOAK, SOAK_SPEED = 1800.0, 10.0  # [s] simulated, simulated seconds per second
QUIET = 3.0  # [s] of simulation time: a client treats a longer gap between heartbeats as a lost link


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


def start(scene, folder, *more):
    command = [sys.executable, "-m", "lapwing", "run", scene, "--key-prefix", "bench-mavlink", *more]
    command += ["--log", str(folder / "flight.mcap"), "--json", str(folder / "figures.json")]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


def adapter_ticks(process):
    """Return the processor time [s] of the link's process, None before it exists."""
    child = participants(process.pid).get("mavlink")
    if child is None:
        return None
    fields = Path(f"/proc/{child}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / 100.0


def start_times(folder):
    """Return the times from the start of a run to its first heartbeat and first position [s]."""
    port = free_port()
    station = mavutil.mavlink_connection(f"udpin:127.0.0.1:{port}")
    began, result = time.perf_counter(), []
    with start(GROUND, folder, "--mavlink", f"udpout:127.0.0.1:{port}", "--set", "run.duration=1") as run:
        for kind in ("HEARTBEAT", "GLOBAL_POSITION_INT"):
            station.recv_match(type=kind, blocking=True, timeout=300)
            result.append(time.perf_counter() - began)
        run.communicate(timeout=120)
    station.close()
    return result


def real_time(folder):
    """Return the share of a core, jitter (median, p99, worst) [ms], messages per second, and the report of the link."""
    port = free_port()
    station = mavutil.mavlink_connection(f"udpin:127.0.0.1:{port}")
    with start(MISSION, folder, "--mavlink", f"udpout:127.0.0.1:{port}", "--set", f"run.duration={SECONDS}") as run:
        station.recv_match(type="ATTITUDE", blocking=True, timeout=300)
        time.sleep(2.0)  # skip the start-up
        while station.recv_msg():
            pass
        used, began, arrived, count = adapter_ticks(run), time.monotonic(), [], 0
        while time.monotonic() < began + SECONDS - 8.0:
            message = station.recv_match(blocking=True, timeout=1.0)
            count += message is not None
            if message and message.get_type() == "ATTITUDE":
                arrived.append(time.perf_counter())
        elapsed = time.monotonic() - began
        share = (adapter_ticks(run) - used) / elapsed
        output, _ = run.communicate(timeout=120)
    station.close()
    jitter = [1e3 * abs(b - a - 0.02) for a, b in pairwise(arrived)]
    report = next((line for line in output.splitlines() if "telemetry" in line), "")
    return share, (median(jitter), percentile(jitter, 0.99), max(jitter)), count / elapsed, report


def top_speed(folder, *more):
    """Return the real-time factor of the mission at top speed."""
    with start(MISSION, folder, "--speed", "max", "--set", "run.duration=20", *more) as run:
        run.communicate(timeout=300)
    return json.loads((folder / "figures.json").read_text())["real_time_factor"]


def fly_for_long(folder):
    """Fly up and down for 30 simulated minutes. Return (simulated [s], wall [s], longest gap [s], flights)."""
    port = free_port()
    station = mavutil.mavlink_connection(f"udpin:127.0.0.1:{port}")
    more = ["--speed", f"{SOAK_SPEED:g}"]
    more += ["--set", "autopilot.follow_trajectory=false", "--set", f"run.duration={SOAK:g}"]
    gaps, last, flights, airborne, sent, now, requested = [0.0], None, 0, False, 0.0, 0.0, -1e9
    with start("lapwing/scenes/hover.toml", folder, "--mavlink", f"udpout:127.0.0.1:{port}", *more) as run:
        began = None
        while run.poll() is None:
            message = station.recv_match(blocking=True, timeout=1.0)
            if time.monotonic() - sent > 1.0 and last is not None:
                sent = time.monotonic()
                station.mav.heartbeat_send(6, 8, 0, 0, 0)
            if message is None:
                continue
            kind = message.get_type()
            if kind == "ATTITUDE":
                now = message.time_boot_ms * 1e-3
            if kind == "HEARTBEAT":
                began = began or time.monotonic()
                gaps += [now - last] if last is not None else []
                last = now
            if kind == "EXTENDED_SYS_STATE" and now - requested > 5.0:
                requested, landed = now, message.landed_state == 1
                flights += airborne and landed
                airborne = not landed
                orders = [(400, 1.0), (22,)] if landed else [(21,)]
                for number, *params in orders:
                    fields = [*params, *[0.0] * (4 - len(params)), float("nan"), float("nan"), float("nan")]
                    station.mav.command_long_send(1, 1, number, 0, *fields)
        wall = time.monotonic() - (began or time.monotonic())
    station.close()
    return now, wall, max(gaps), flights


def main(soak: bool = False) -> list[Row]:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if soak:
            simulated, wall, gap, flights = fly_for_long(folder)
            print(f"{simulated:.0f} s simulated in {wall:.0f} s, {flights} flights")
            return show(
                [
                    Row("link: longest gap in simulation time", gap, "s", QUIET),
                    Row("link: simulated time", simulated, "s", 0.99 * SOAK, True),
                ]
            )
        starts = [start_times(folder) for _ in range(REPEATS)][1:]  # the first run loads the disk cache
        heartbeat, position = (median(times) for times in zip(*starts, strict=True))
        share, (middle, p99, worst), rate, report = real_time(folder)
        print(f"one client at PX4's rates: {100.0 * share:.1f} % of a core, {rate:.0f} messages/s")
        print(f"50 Hz as the client sees it: jitter median {middle:.2f} ms, p99 {p99:.2f} ms, worst {worst:.1f} ms")
        print(f"reported by the link: {report}")
        variants = {
            "no operator": [],
            "commands accepted": ["--set", "autopilot.accept_commands=true"],
            "with a link": ["--mavlink", f"udpout:127.0.0.1:{free_port()}"],
        }
        factors = {name: [] for name in variants}
        for _ in range(REPEATS):
            for name, more in variants.items():
                factors[name].append(top_speed(folder, *more))
        best = max(factors["no operator"])
        rows = [
            Row("link: from the command to the first heartbeat, warm", heartbeat, "s", 2.0),
            Row("link: from the command to the first position, warm", position, "s", 2.0),
            Row("link: one client in real time", 100.0 * share, "% of a core", 3.0),
        ]
        for name, result in factors.items():
            change = 100.0 * (max(result) / best - 1.0)
            print(f"lock step at top speed, {name}: {max(result):.2f} x real time, {change:+.1f} %")
        return show(rows)


if __name__ == "__main__":
    command_line(main)
