"""SIGINT and SIGTERM end a command whose controller never returns, and name its block. No bound on the wall clock."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from lapwing.cosim.log.log_reader import LogReader
from lapwing.cosim.processes.watchdog import Watchdog

CONTROLLER = """
import multiprocessing
import os
from pathlib import Path

import numba

from lapwing.plugins import ThrustAndMoments

@numba.njit("int64()", nogil=True)
def compiled():
    x = 0
    while x >= 0:
        x = (x + 1) % 7
    return x

def python():
    while True:
        pass

def python_that_catches_all():
    while True:
        try:
            python()
        except BaseException:
            pass

def library_with_gil():
    sum(range(10**15))

class Hanging:
    rate = 250.0

    def __init__(self, vehicle):
        self.calls = 0

    def step(self, time, estimate, setpoint):
        self.calls += 1
        if self.calls > calls():
            Path(f"hangs-{os.getpid()}").touch()
            globals()[os.environ["HANG"]]()
        return ThrustAndMoments(90.0, (0.0, 0.0, 0.0), (0.0, 0.0))
"""
BLOCK = "block autopilot.controller did not return"
TIMEOUT = 300.0  # [s] for a machine of load 20; idle, each command ends within 5 s


def end(folder, hang, number, *command, hanging=1, calls="100", by=()):
    """Run a command until its controller hangs, and send it a signal. Return its exit code, error and time [s]."""
    (folder / "hanging.py").write_text(f"{CONTROLLER}\n\ndef calls():\n    return {calls}\n")
    environment = os.environ | {"PYTHONPATH": f"{Path.cwd()}:{folder}", "HANG": hang}
    arguments = [*by, sys.executable, "-m", "lapwing", *command, "--set", "autopilot.controller=hanging:Hanging"]
    process = subprocess.Popen(
        arguments, cwd=folder, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )
    try:
        while len(list(folder.glob("hangs-*"))) < hanging:
            assert process.poll() is None, process.stderr.read()
            time.sleep(0.1)
        process.send_signal(number)
        start = time.monotonic()
        error = process.communicate(timeout=TIMEOUT)[1]
    finally:
        process.kill()
    return process.returncode, error, time.monotonic() - start


@pytest.mark.long
@pytest.mark.parametrize(
    ("mode", "hang", "number", "whole"),
    [
        ("single-process", "python", signal.SIGTERM, True),
        ("single-process", "python_that_catches_all", signal.SIGINT, False),
        ("single-process", "compiled", signal.SIGINT, False),
        ("single-process", "library_with_gil", signal.SIGTERM, False),
        ("multi-process", "python", signal.SIGINT, True),
        ("multi-process", "library_with_gil", signal.SIGTERM, True),
    ],
)
def test_signal_ends_run_whose_block_hangs(tmp_path, record_property, mode, hang, number, whole):
    options = ["run", "hover", "--mode", mode, "--log", "flight.mcap"]
    code, error, seconds = end(tmp_path, hang, number, *options, by=["nohup"] if hang == "library_with_gil" else [])
    record_property("seconds", seconds)
    service = "autopilot: " if mode == "multi-process" else ""
    assert (code, error) == (128 + number, f"lapwing: ended by {number.name}; {service}{BLOCK}\n")
    with LogReader(tmp_path / "flight.mcap") as log:
        assert log.metadata.get("failure", "").startswith("the run was ended") == whole
        assert ("digest" in log.metadata) == whole


COMPILER = """
import sys
from pathlib import Path
from lapwing.cli.entry_point import main
from lapwing.kernels.compiler import cache

def load(self, *arguments):  # a compilation that holds the GIL
    for listener in cache._listeners:
        listener("kernel")
    if cache._listeners:
        Path("compiles").touch()
        sum(range(10**15))
    return found(self, *arguments)

found, cache.KernelCache.load_overload = cache.KernelCache.load_overload, load
main()
"""
SERVICES = "compiling kernels of plant, autopilot, trajectory\n"


@pytest.mark.long
@pytest.mark.parametrize("mode", ["single-process", "multi-process"])
def test_signal_ends_run_while_it_compiles(tmp_path, mode):
    command = [sys.executable, "-c", COMPILER, "run", "hover", "--mode", mode]
    environment = os.environ | {"PYTHONPATH": str(Path.cwd())}
    run = subprocess.Popen(command, cwd=tmp_path, env=environment, stderr=subprocess.PIPE, text=True)
    try:
        while not (tmp_path / "compiles").exists():
            assert run.poll() is None, run.stderr.read()
            time.sleep(0.1)
        run.send_signal(signal.SIGTERM)
        error = run.communicate(timeout=TIMEOUT)[1]
    finally:
        run.kill()
    assert (run.returncode, error) == (143, f"lapwing: ended by SIGTERM; {SERVICES}")


@pytest.mark.long
def test_signal_ends_command_that_hangs_before_the_run(tmp_path):
    code, error, _ = end(tmp_path, "library_with_gil", signal.SIGTERM, "run", "hover", calls="0")
    assert (code, error) == (143, "lapwing: ended by SIGTERM; the program did not end by itself\n")


@pytest.mark.long
def test_signal_ends_campaign_whose_workers_hang(tmp_path):
    in_worker = "100 if multiprocessing.parent_process() else 10**9"  # the first flight is that of the parent
    options = ("--runs", "2", "--workers", "2", "--out", "campaign")
    code, error, _ = end(
        tmp_path, "library_with_gil", signal.SIGINT, "campaign", "hover", *options, hanging=2, calls=in_worker
    )
    assert (code, error) == (130, "lapwing: ended by SIGINT\n")
    for pid in (int(path.name.removeprefix("hangs-")) for path in tmp_path.glob("hangs-*")):
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)


def test_watchdog_gives_back_wakeup_descriptor():
    before = signal.set_wakeup_fd(-1)
    with Watchdog():
        pass
    assert signal.set_wakeup_fd(before) == -1
