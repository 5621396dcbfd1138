"""Scheduler settings of lock-step processes."""

import os
import subprocess
import sys

import pytest

from lapwing.cosim.executors.lockstep import batch

POLICIES = """
import os, threading
from lapwing.cosim.executors.lockstep import batch
threading.Thread(target=threading.Event().wait, daemon=True).start()
batch()
print(*{os.sched_getscheduler(int(thread)) for thread in os.listdir("/proc/self/task")})
"""


@pytest.mark.skipif(not hasattr(os, "SCHED_BATCH"), reason="no such class")
def test_all_threads_have_batch_scheduling_policy():
    reported = subprocess.run([sys.executable, "-c", POLICIES], capture_output=True, text=True, check=True).stdout
    assert reported.split() == [str(os.SCHED_BATCH)]


@pytest.mark.skipif(not hasattr(os, "SCHED_BATCH"), reason="no such class")
def test_scheduling_policy_of_user_is_kept(monkeypatch):
    monkeypatch.setattr(os, "sched_getscheduler", lambda process: os.SCHED_IDLE)
    monkeypatch.setattr(os, "sched_setscheduler", lambda *_: pytest.fail("it was changed"))
    batch()
