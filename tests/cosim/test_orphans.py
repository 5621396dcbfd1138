"""A process ends and leaves no folder when its launcher has ended, even while it is busy."""

import subprocess
import sys

BUSY = """
import sys, time
from types import SimpleNamespace
from lapwing.cosim.executors import stop_request as process
process.ORPHANED = 0.1
process.StopRequest.stop_with_parent(SimpleNamespace(), sys.argv[1])
print("busy", flush=True)
time.sleep(600.0)
"""


def test_busy_orphan_process_exits(tmp_path):
    folder = tmp_path / "sockets"
    folder.mkdir()
    command = [sys.executable, "-c", BUSY, f"unixsock-stream/{folder}/plant"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as busy:
        assert busy.stdout.readline() == b"busy\n"
        assert busy.poll() is None
        busy.stdin.close()
        assert busy.wait(60.0) == 1
    assert not folder.exists()
