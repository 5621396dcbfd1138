"""How the scheduler is asked to treat the processes of a lock step."""

import os
import subprocess
import sys

import pytest

TOLD = """
import os, threading
from cosim.lockstep import batch
threading.Thread(target=threading.Event().wait, daemon=True).start()
if {policy}:
    os.sched_setscheduler(0, {policy}, os.sched_param(0))
batch()
print(sorted({{os.sched_getscheduler(int(thread)) for thread in os.listdir("/proc/self/task")}}))
"""


def policies(before):
    code = TOLD.format(policy=before)
    return eval(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout)


@pytest.mark.skipif(not hasattr(os, "SCHED_BATCH"), reason="no such class")
def test_all_threads_of_an_ordinary_process_are_batch_work():
    assert policies(0) == [os.SCHED_BATCH]


@pytest.mark.skipif(not hasattr(os, "SCHED_IDLE"), reason="no such class")
def test_what_somebody_has_set_is_left():
    assert os.SCHED_BATCH not in policies(os.SCHED_IDLE)
