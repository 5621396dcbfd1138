"""Lock-step processes: scheduler settings and missed deadlines."""

import os
import subprocess
import sys

import pytest

from lapwing import Flight
from lapwing.cosim.executors.lockstep import batch
from lapwing.cosim.executors.realtime import MISSED, WORST, Deadlines, Lateness, lateness, metadata_entries
from lapwing.cosim.log import LogReader
from lapwing.views.report.flight_header import facts
from tests.commands import run_command

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


@pytest.mark.long
def test_late_ticks_are_counted_and_worst_lateness_is_kept():
    deadlines = Deadlines()
    for late in (-1e-3, 2e-3, 0.0, 5e-3, 1e-3):
        deadlines.note(late)
    assert lateness(deadlines.to_text()) == Lateness(3, 5e-3)
    assert metadata_entries({"plant": Lateness(3, 5e-3), "autopilot": Lateness(0, 0.0)}) == {
        MISSED: "autopilot 0, plant 3",
        WORST: "autopilot 0.00 ms, plant 5.00 ms",
    }
    assert metadata_entries({}) == {}


@pytest.mark.long
@pytest.mark.parametrize("messages", ["", "1", "[1]", "[1, 2, 3]", '["a", 1]', "null"])
def test_invalid_lateness_is_rejected(messages):
    with pytest.raises(ValueError):
        lateness(messages)


@pytest.mark.long
@pytest.mark.parametrize(("more", "paced"), [(("--realtime",), True), ((), False)], ids=["real time", "full speed"])
def test_log_has_lateness_of_paced_run(tmp_path, more, paced):
    log = tmp_path / "log.mcap"
    command = ["run", "gyrostat_blocked", "--set", "run.duration=1.0", *more, "--log", log]
    done = run_command(*command, code=0)
    assert "Traceback" not in done.stderr
    with LogReader(log) as read:
        assert (MISSED in read.metadata) == paced
        if paced:
            assert [word.split()[0] for word in read.metadata[MISSED].split(", ")] == ["plant"]
    assert ("deadlines missed" in facts(Flight.read(log))) == paced
