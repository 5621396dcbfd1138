"""Detection of processes that wait for a processor, unlike stopped, sleeping or endless ones."""

import os
import signal
import subprocess
import sys
import time
from collections import Counter
from types import SimpleNamespace

import pytest

from lapwing.cosim.access.publisher_ids import PublisherIds
from lapwing.cosim.processes import patience
from lapwing.cosim.processes.patience import (
    QUIET,
    Patience,
    Starvation,
    growth,
    machine_stall_time,
    process_state,
    starved_times,
)
from lapwing.cosim.processes.run_monitor import LONGEST, RunMonitor

pytestmark = pytest.mark.skipif(not os.path.exists("/proc/self/schedstat"), reason="the system does not tell")

SPIN = """
import os, sys
os.sched_setaffinity(0, {int(sys.argv[1])})
os.nice(int(sys.argv[2]))
print(flush=True)
while True: pass
"""
SLEEP = "import time\nprint(flush=True)\ntime.sleep(60)"


@pytest.fixture
def start():
    """Yield a function that starts Python programs; kill the programs at the end."""
    children = []

    def begin(program, *arguments):
        command = [sys.executable, "-c", program, *map(str, arguments)]
        children.append(subprocess.Popen(command, stdout=subprocess.PIPE))
        children[-1].stdout.readline()
        return children[-1].pid

    yield begin
    for child in children:
        child.kill()
        child.communicate()


def measured(pid, seconds=1.5):
    before = starved_times(pid)
    time.sleep(seconds)
    return growth(starved_times(pid), before)


@pytest.mark.long
def test_only_starved_process_extends_wait(start):
    core = min(os.sched_getaffinity(0))
    for _ in range(2):
        start(SPIN, core, 0)
    assert measured(start(SPIN, core, 10)) > 0.7
    assert measured(start(SLEEP)) < 0.1
    stopped = start(SPIN, core, 10)
    os.kill(stopped, signal.SIGSTOP)
    os.waitpid(stopped, os.WUNTRACED)  # a process needs the processor to stop
    assert measured(stopped) < 0.1


def test_exited_process_has_no_waiting_time():
    child = subprocess.Popen([sys.executable, "-c", ""])
    child.wait()
    assert not starved_times(child.pid)


def test_ended_thread_hides_no_waiting_time_of_others(monkeypatch):
    times, now = Counter({1: 8_000_000_000, 2: 30_000_000_000}), [0.0]
    monkeypatch.setattr("lapwing.cosim.processes.patience.starved_times", lambda pid: times.copy())
    monkeypatch.setattr("lapwing.cosim.processes.patience.machine_stall_time", lambda: 0.0)
    patience = Patience(4.0, clock=lambda: now[0])
    now[0] = 3.0
    assert not patience.over
    del times[2]
    times[1] += 6_000_000_000
    now[0] = 9.9
    assert not patience.over
    now[0] = 10.1
    assert patience.over


def test_stall_of_machine_sums_its_counts(monkeypatch, tmp_path):
    """Numbers in the format of the kernel's documentation (accounting/psi, filesystems/proc)."""
    assert machine_stall_time() >= 0.0
    (tmp_path / "io").write_text("some avg10=0.10 avg60=0.00 avg300=0.00 total=2500000\nfull avg10=0.00 total=1\n")
    (tmp_path / "stat").write_text("cpu  1 2 3 4 5 6 7 300 9 10\ncpu0 1 2 3 4 5 6 7 8 9 10\n")
    monkeypatch.setattr(patience, "PRESSURE", (tmp_path / "io", tmp_path / "missing"))
    monkeypatch.setattr(patience, "PROCESSORS", tmp_path / "stat")
    assert machine_stall_time() == 2.5 + 300 / os.sysconf("SC_CLK_TCK")


def test_starvation_counts_from_last_message(monkeypatch):
    times = {1: Counter({1: 5_000_000_000}), 2: Counter({2: 7_000_000_000})}
    stall = [100.0]
    monkeypatch.setattr("lapwing.cosim.processes.patience.starved_times", lambda pid: times[pid].copy())
    monkeypatch.setattr("lapwing.cosim.processes.patience.machine_stall_time", lambda: stall[0])
    starvation, pids = Starvation(), {"plant": 1, "sensors": 2}
    starvation.look(pids, 0.0)
    assert starvation.of(pids) == 0.0
    starvation.look(pids, QUIET)
    times[1][1] += 1_000_000_000
    times[2][2] += 500_000_000
    starvation.look(pids, 2 * QUIET)
    assert starvation.of(pids) == 1.5
    assert starvation.of(["plant", "somewhere else"]) == 1.0
    times[2] = Counter()  # it has ended
    assert starvation.of(["sensors"]) == 0.0
    stall[0] = 102.0  # the machine waited for its disk
    assert starvation.of(["sensors"]) == 2.0
    starvation.look(pids, 0.1)
    starvation.look(pids, QUIET)
    assert starvation.of(pids) == 0.0


@pytest.fixture
def watch():
    """Return a monitor of two services that has received no message."""
    bus = SimpleNamespace(receive=lambda senders: None, watch_liveliness=lambda key, seen: None)
    return RunMonitor(bus, PublisherIds("test"), ["plant", "sensors"])


def silent_for(watch, seconds):
    watch.last_news = time.monotonic() - seconds


def test_starved_service_is_not_stalled(watch):
    names = ["plant", "sensors"]
    silent_for(watch, 2.4)
    assert watch.stall_message(names) is None
    silent_for(watch, 2.6)
    assert watch.stall_message(names) == "plant, sensors: no answer for 2.5 s, at t = 0.000 s"
    assert watch.stall_message(names, lambda who: 0.0)
    assert watch.stall_message(names, lambda who: 0.2) is None
    silent_for(watch, 20.0)
    assert watch.stall_message(names, lambda who: 17.6) is None
    assert watch.stall_message(names, lambda who: 17.0)


def test_waiting_service_does_not_hide_stalled_service(watch):
    silent_for(watch, 2.6)
    watch.waiting["sensors"] = "the truth"
    starved = {"plant": 0.0, "sensors": 2.0}
    result = watch.stall_message(starved, lambda who: sum(starved[name] for name in who))
    assert result == "plant: no answer for 2.5 s, at t = 0.000 s"


def test_starved_service_is_not_reported_as_router_stall():
    bus = SimpleNamespace(receive=lambda senders: None, watch_liveliness=lambda key, seen: None)
    names = ["plant", "sensors", "router"]
    watch = RunMonitor(bus, PublisherIds("test"), names, services=names[:2])
    silent_for(watch, 2.6)
    watch.waiting.update(plant="sensors", sensors="plant")
    starved = dict.fromkeys(names, 0.0) | {"plant": 0.2}
    assert watch.stall_message(names, lambda who: sum(starved[name] for name in who)) is None
    assert watch.stall_message(names) == "router: no answer for 2.5 s, at t = 0.000 s"


def test_starvation_excuse_is_bounded(watch):
    silent_for(watch, LONGEST + 0.1)
    assert watch.stall_message(["plant"], lambda who: LONGEST)


def test_timeout_does_not_pass_while_process_is_stopped(start):
    pid, now = start(SLEEP), [0.0]
    patience = Patience(1.0, pid, pauses=True, clock=lambda: now[0])
    os.kill(pid, signal.SIGSTOP)
    while process_state(pid) != "T":
        time.sleep(0.01)
    for now[0] in range(100):
        assert not patience.over
    os.kill(pid, signal.SIGCONT)
    while process_state(pid) == "T":
        time.sleep(0.01)
    now[0] += 0.9
    assert not patience.over
    now[0] += 20.0
    assert patience.over
