"""A recorder that gets no processor time while it joins: other processes may leave before it looks for them."""

import subprocess
import sys

from lapwing.cosim.log import LogReader

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
