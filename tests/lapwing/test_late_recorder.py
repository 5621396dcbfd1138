"""Processes that get no processor time while they start."""

import os
import subprocess
import sys
import time

import pytest

from lapwing.cosim.log import LogReader
from tests.combinations import NIGHTLY
from tests.participants import participants

LATE = """
import sys
import time
from pathlib import Path
from lapwing.cli.entry_point import main
from lapwing.cosim.transport.bus import ZenohBus

declare, stalled = ZenohBus.declare_liveliness, Path(sys.argv.pop(1))

def declare_and_stall(bus, key):
    result = declare(bus, key)
    if key.endswith("/recorder"):
        stalled.touch()
        time.sleep(1.0)
    return result

ZenohBus.declare_liveliness = declare_and_stall
main()
"""


def test_late_recorder_writes_complete_log(tmp_path):
    log, stalled = tmp_path / "a.mcap", tmp_path / "stalled"
    options = ["--set", "run.duration=0.3", "--set", "success.require=[]", "--mavlink", "udpout:127.0.0.1:9"]
    command = [sys.executable, "-c", LATE, str(stalled), "run", "hover", *options, "--speed", "max", "--log", str(log)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert (done.returncode, done.stderr) == (0, ""), done.stdout
    assert stalled.exists()
    with LogReader(log) as read:
        assert read.complete
        assert max(time_ns for _, _, time_ns, _ in read.messages()) == int(0.3e9)


SPEED = "0.5"  # the flight of 9.5 s takes long enough for full buffers
BURN = "import os, sys\nos.sched_setaffinity(0, {int(sys.argv[1])})\nwhile True: pass"


def schedule(pid, policy):
    for thread in os.listdir(f"/proc/{pid}/task"):
        os.sched_setscheduler(int(thread), policy, os.sched_param(0))


@pytest.mark.long
@NIGHTLY
@pytest.mark.skipif(not hasattr(os, "SCHED_IDLE"), reason="the system has no class for idle processes")
def test_run_of_starved_launcher_ends_with_complete_log(tmp_path):
    log, core = tmp_path / "a.mcap", min(os.sched_getaffinity(0))
    command = [sys.executable, "-m", "lapwing", "run", "hover", "--speed", SPEED, "--log", str(log)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as launcher:
        while launcher.poll() is None and not (log.exists() and log.stat().st_size):
            time.sleep(0.05)
        os.sched_setaffinity(launcher.pid, {core})
        schedule(launcher.pid, os.SCHED_IDLE)
        burner = subprocess.Popen([sys.executable, "-c", BURN, str(core)])
        while launcher.poll() is None and participants(launcher.pid):
            time.sleep(0.5)
        burner.kill()
        burner.wait()
        if launcher.poll() is None:
            schedule(launcher.pid, os.SCHED_OTHER)
        output, error = launcher.communicate()
    assert (launcher.returncode, error) == (0, ""), output
    assert "Landed at 9.04 s" in output
