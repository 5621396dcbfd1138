"""A flight whose participants run on several hosts of a network."""

import subprocess
import sys
import time

from lapwing.cosim.processes.run_monitor import MONITOR

SLOWEST = 120.0  # [s] for a run to begin, and for it to end
_GROWN = 8  # different sizes of a growing log, the first of which are of its head


class Run:
    """One process for each participant; the context ends all of them.

    Attributes:
        log: path of the log.
        participants: processes by name.
    """

    def __init__(self, network, places, overrides, keys, folder):
        """Start `delivery_mission`; `places` maps participants to hosts, `keys` is the folder of certificates."""
        peers = {name: f"tls/{network.addresses[host]}:{7447 + k}" for k, (name, host) in enumerate(places.items())}
        table = ",".join(f"{name}={endpoint}" for name, endpoint in peers.items())
        sets = [word for override in overrides for word in ("--set", override)]
        self.log = folder / "log.mcap"
        self.participants = {}
        for name, host in places.items():
            command = ["run"] if name == MONITOR else ["service", name]
            more = ["--speed", "1"] if name == "plant" else []
            if name in (MONITOR, "recorder"):
                more = ["--log", str(self.log)]
            words = [*command, "delivery_mission", *sets, "--endpoints", table, "--keys", str(keys), *more]
            self.participants[name] = subprocess.Popen(
                network.command(host, sys.executable, "-m", "lapwing", *words),
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                text=True,
            )

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for process in self.participants.values():
            process.kill()
            process.communicate()

    def flies(self):
        """Wait until the log has grown several times. Return False if it has not."""
        sizes, deadline = set(), time.monotonic() + SLOWEST
        while len(sizes) < _GROWN and time.monotonic() < deadline:
            sizes.add(self.size())
            time.sleep(0.02)
        return len(sizes) == _GROWN

    def size(self):
        """Return the size of the log [bytes]."""
        return self.log.stat().st_size if self.log.exists() else 0

    def ends(self):
        """Return the exit code and standard error of each participant; kill those that do not end in time."""
        result = {}
        for name, process in self.participants.items():
            try:
                _, output = process.communicate(timeout=SLOWEST)
            except subprocess.TimeoutExpired:
                process.kill()
                output = process.communicate()[1] + f"still there after {SLOWEST:g} s"
            result[name] = process.returncode, output
        return result
