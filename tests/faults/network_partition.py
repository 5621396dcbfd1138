"""A run on several hosts, one of which is disconnected for some time or permanently."""

import time
from pathlib import Path

from lapwing.cosim.access.certificates import make
from lapwing.cosim.log import LogReader
from lapwing.cosim.processes.run_monitor import MONITOR
from tests.hosts.network import Network
from tests.hosts.run import Run

HOSTS = ("plant", "sensors", "autopilot", "trajectory", "recorder", MONITOR)  # one host each
KINDS = ("cut", "cut off")  # for some time, permanently
WHILE = 2.0  # [s] of a cut that a run survives
RECOVERED = 0.5  # [s] before the cut, up to which a log must be complete


def fly(victim: str, kind: str, delay: float, folder: Path) -> tuple[int, str, float, list[str]]:
    """Disconnect a host. Return the mission's exit code and standard error, seconds to the last exit, and errors.

    Args:
        victim: participant on the host.
        kind: one of `KINDS`.
        delay: [s] into the flight.
        folder: for the keys and the log.
    """
    ever = kind == "cut off"
    make(folder / "keys", HOSTS, 1)
    sets = ["run.duration=5", "success.require=[]"]
    with Network(HOSTS) as network, Run(network, {name: name for name in HOSTS}, sets, folder / "keys", folder) as run:
        if not run.flies():
            return 1, "", 0.0, ["the run did not begin"]
        time.sleep(delay)
        over = run.participants["recorder"].poll() is not None
        network.cut_off = {victim}
        struck = time.monotonic()
        if not ever:
            time.sleep(WHILE)
            network.cut_off = set()
        ends = run.ends()
    seconds = time.monotonic() - struck
    code, output = ends[MONITOR]
    wrong = [f"{name}: a traceback: {words}" for name, (_, words) in ends.items() if "Traceback" in words]
    wrong += [f"{name} was left: {words}" for name, (c, words) in ends.items() if c < 0]
    if over or not ever:
        wrong += [f"{name} ended with exit code {c}: {words}" for name, (c, words) in ends.items() if c]
    elif code == 1:
        named = output.partition(": ")[2].partition(": ")[0].split(", ")
        if named != ([victim] if victim != MONITOR else sorted(set(HOSTS) - {MONITOR})):
            wrong.append(f"names the wrong participants: {output}")
    elif code:
        wrong.append(f"exit code {code}: {output}")
    if (stated := output.partition("at t = ")[2]) and victim != "recorder":  # the others continue without it
        with LogReader(run.log) as read:
            last = max(time_ns for _, _, time_ns, _ in read.messages()) * 1e-9
        if last < float(stated.split()[0].rstrip(":;,")) - RECOVERED:
            wrong.append(f"the log ends at {last:.3f} s: {output}")
    return code, output, seconds, wrong
