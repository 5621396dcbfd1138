"""A recorder that gets no processor time while it joins: other processes may leave before it looks for them."""

import subprocess
import sys

from lapwing.cosim.log import LogReader

LATE = """
import time
from lapwing.cli.entry_point import main
from lapwing.cosim.transport.bus import ZenohBus

declare = ZenohBus.declare_liveliness

def declare_and_stall(bus, key):
    result = declare(bus, key)
    if key.endswith("/recorder"):
        print("stalled", flush=True)
        time.sleep(1.0)
    return result

ZenohBus.declare_liveliness = declare_and_stall
main()
"""


def test_late_recorder_writes_complete_log(tmp_path):
    log = tmp_path / "a.mcap"
    options = ["--set", "run.duration=0.3", "--set", "success.require=[]", "--mavlink", "udpout:127.0.0.1:9"]
    command = [sys.executable, "-c", LATE, "run", "hover", *options, "--speed", "max", "--log", str(log)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert (done.returncode, done.stderr) == (0, ""), done.stdout
    with LogReader(log) as read:
        assert read.complete
        assert max(time_ns for _, _, time_ns, _ in read.messages()) == int(0.3e9)
