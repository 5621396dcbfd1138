"""Worker processes always end with their parent process."""

import errno
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from lapwing.studies.workers import workers
from tests.participants import running

pytestmark = pytest.mark.long

PATIENCE = 120.0  # [s] a generous bound; the target is a second
SCRIPT = """
import os, time
from lapwing.cosim.processes.interrupt import raise_on_interrupt
from lapwing.studies.workers import workers

if __name__ == "__main__":
    raise_on_interrupt()
    with workers(2) as pool:
        busy = [pool.submit(time.sleep, 3600.0) for _ in range(2)]
        while not all(job.running() for job in busy):
            time.sleep(0.05)
        print(*pool._processes, flush=True)
        busy[0].result()
"""


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT, signal.SIGTERM])
def test_workers_end_with_interrupted_or_killed_parent(tmp_path, number):
    if not Path("/proc/self/stat").exists():
        pytest.skip("finds processes in /proc")
    (tmp_path / "flies.py").write_text(SCRIPT)
    paths = os.pathsep.join([str(Path.cwd()), os.environ.get("PYTHONPATH", "")])
    parent = subprocess.Popen(
        [sys.executable, str(tmp_path / "flies.py")],
        stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, env={**os.environ, "PYTHONPATH": paths},
    )  # fmt: skip
    workers: list[int] = []
    try:
        workers = [int(pid) for pid in parent.stdout.readline().split()]
        assert len(workers) == 2
        assert all(map(running, workers))
        parent.send_signal(number)
        parent.wait(PATIENCE)
        deadline = time.monotonic() + PATIENCE
        while any(map(running, workers)) and time.monotonic() < deadline:
            time.sleep(0.05)
        assert not [pid for pid in workers if running(pid)]
    finally:
        for pid in [parent.pid, *workers]:
            if running(pid):
                os.kill(pid, signal.SIGKILL)
        parent.stdout.close()
        parent.wait()


def test_unavailable_workers_error_is_one_line(monkeypatch):
    def fails(*_):
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    monkeypatch.setattr("lapwing.studies.workers.ProcessPoolExecutor", fails)
    output = "worker processes need semaphores: read-only file system; expected a /dev/shm to write to"
    with pytest.raises(ValueError, match=output), workers(2):
        pass


LOST = """
import os
import lapwing.studies.stability.case_runner as case_runner
from lapwing.cli.entry_point import main
from lapwing.views.studies import stability_result

def lost(name, sweep):
    os._exit(9)

case_runner.run_case = lost
case_runner.os.cpu_count = lambda: 2
if __name__ == "__main__":
    main()
"""


def test_lost_worker_of_study_is_one_line_without_resumption(tmp_path):
    (tmp_path / "loses.py").write_text(LOST)
    command = [sys.executable, str(tmp_path / "loses.py"), "stability"]
    environment = {**os.environ, "PYTHONPATH": str(Path.cwd())}
    done = subprocess.run(
        command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=PATIENCE, check=False
    )
    assert (done.returncode, done.stderr.count("\n")) == (1, 1)
    assert "a worker process has ended unexpectedly" in done.stderr
    assert done.stderr.endswith("; run the same command again\n")
