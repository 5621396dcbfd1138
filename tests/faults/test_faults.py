"""Faults end runs as specified; stress and soak runs."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.combinations import NIGHTLY
from tests.faults import campaign, leak_checks, memory_pressure, network_partition
from tests.faults.soak import Use, grown, soak
from tests.faults.stress import trial
from tests.faults.trial import Trial, draw, fly
from tests.hosts.network import why_not

FEW = {
    "a service waits for a frozen one that goes on": Trial(0, "hover", "pause", 0.0, 4.0),
    "frozen before it has joined": Trial(0, "hover", "freeze", 0.5, 0.2),
    "the launcher stays frozen": Trial(0, "hover", "freeze", 1.0, 4.0),
    "interrupted while it starts": Trial(0, "gyrostat_attitude", "Ctrl-C", 1.0, 0.4),
    "interrupted while it compiles": Trial(1, "gyrostat_attitude", "Ctrl-C", 1.0, 3.0),
    "run monitor is cut off for good, with much unsent": Trial(4042, "delivery_mission", "cut off", 0.99, 1.7),
    "a worker of a campaign is killed": Trial(0, "hover", "campaign worker", 0.7, 4.0),
    "a campaign is interrupted while it compiles": Trial(1, "hover", "campaign Ctrl-C", 0.9, 6.0),
    "a campaign is killed while it compiles": Trial(1, "hover", "campaign kill", 0.0, 5.0),
    "the disk is full": Trial(0, "hover", "full disk", 0.0, 3.0),
}
EVERY_DAY = ("a service waits for a frozen one that goes on", "a worker of a campaign is killed")


@pytest.mark.long
@pytest.mark.parametrize(
    "trial", [pytest.param(trial, id=name, marks=() if name in EVERY_DAY else NIGHTLY) for name, trial in FEW.items()]
)
def test_fault_ends_run_as_specified(trial):
    if not Path("/proc/self/stat").exists():
        pytest.skip("finds processes in /proc")
    if trial.kind == "full disk" and os.geteuid() != 0:
        pytest.skip("mounts a small disk, as root")
    if trial.kind in network_partition.KINDS and (reason := why_not()):
        pytest.skip(reason)
    outcome = fly(trial)
    assert not outcome.wrong, outcome


@pytest.mark.long
def test_trial_depends_on_seed_only():
    assert draw(7) == draw(7)
    assert len({draw(seed).kind for seed in range(40)}) >= 4
    assert draw(7, [campaign.KILL]).scene == "hover"


@pytest.mark.long
def test_leftovers_of_trial_are_detected(tmp_path):
    """Detect a process of the trial, its listening port and its lock."""
    (tmp_path / "cache" / leak_checks.LOCKS).mkdir(parents=True)
    lock = tmp_path / "cache" / leak_checks.LOCKS / "kernel"
    with subprocess.Popen([sys.executable, "-c", HOLDS, lock], stdout=subprocess.PIPE, text=True) as holder:
        port = holder.stdout.readline().strip()
        taken = leak_checks.ports(leak_checks.of_trial(tmp_path))
        assert list(taken.values()) == [f"tcp port {port}"]
        there = leak_checks.left(tmp_path, taken, tmp_path / "cache", 0.0)
        holder.kill()
    assert there[0].startswith(f"process {holder.pid} ")
    assert there[1:] == [f"tcp port {port} stays taken"]  # no lock: its holder is alive
    assert leak_checks.left(tmp_path, taken, tmp_path / "cache", 10.0) == []


HOLDS = """
import fcntl, socket, sys, time
with open(sys.argv[1], "w") as lock, socket.create_server(("127.0.0.1", 0)) as server:
    fcntl.flock(lock, fcntl.LOCK_EX)
    print(server.getsockname()[1], flush=True)
    time.sleep(600)
"""


@pytest.mark.parametrize("seed", range(3))
def test_run_with_little_memory_names_killed_process(seed):
    assert memory_pressure.fly(seed, 180.0).wrong == []


@pytest.mark.long
@NIGHTLY
def test_flights_with_ground_station_leave_no_process_port_or_lock():
    flights = soak(["hover", "--set", "run.duration=3"], 600.0)
    first, second = next(flights), next(flights)
    assert first.wrong == second.wrong == []
    assert first.messages > 50
    assert first.use.threads > 10


def test_growth_is_found():
    flat = [Use(100 + k % 3, 40, 30, 50) for k in range(30)]
    assert grown(flat) == []
    leaking = [Use(100, 40 + k, 30, 50) for k in range(30)]
    assert [text.split()[0] for text in grown(leaking)] == ["files"]


@pytest.mark.nightly
@pytest.mark.long
@pytest.mark.parametrize("runs", [4, pytest.param(60, marks=NIGHTLY)])
def test_simultaneous_runs_lose_no_message(runs):
    results = list(trial(runs, min(runs, 6), 0))
    assert len(results) == runs
    assert [result for result in results if result.wrong] == []
