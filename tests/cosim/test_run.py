"""Complete runs: equal digests in every mode, and an orderly end after failures of processes."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

from lapwing.cosim.log import LogReader
from lapwing.cosim.log.log_editing import recover
from lapwing.cosim.transport.bus import ZenohBus
from lapwing.messages import VehicleState
from lapwing.runs.single_process_run import fly_single
from lapwing.services.scene_resolver import load, resolve
from tests.combinations import MISSION
from tests.commands import assert_rejected, run_command
from tests.endpoints import loopback_endpoints
from tests.participants import participants, running

pytestmark = pytest.mark.long

SCENE = Path("lapwing/scenes/hover.toml")
SHORT = ["run.duration=2"]
SERVICES = {"autopilot", "plant", "trajectory", "recorder"}  # of this scene
END = 10.0  # [s] generous limit for the end of a run; the target is 2 s
STARTED = 300.0  # [s] limit for the start of a run, including compilation


def arguments(tmp_path, key_prefix, *more, overrides=()):
    sets = [part for override in overrides for part in ("--set", override)]
    command = [sys.executable, "-m", "lapwing", "run", str(SCENE), *sets, "--key-prefix", key_prefix]
    return [*command, "--log", str(tmp_path / f"{key_prefix}.mcap"), *more]


def single(tmp_path, *overrides):
    """Return the digest of a flight in single-process mode."""
    log = tmp_path / "single.mcap"
    fly_single(resolve(load(SCENE, [*SHORT, *overrides])), log)
    with LogReader(log) as read:
        assert read.complete
        assert read.digest() == read.metadata["digest"]
        return read.digest()


def processes(tmp_path, key_prefix, *overrides):
    """Return the `--json` figures of a flight in multi-process mode."""
    result = tmp_path / f"{key_prefix}.json"
    more = ["--json", str(result)]
    subprocess.run(arguments(tmp_path, key_prefix, *more, overrides=[*SHORT, *overrides]), check=True, timeout=600)
    return json.loads(result.read_text())


class Running:
    """Flying multi-process run at real-time speed; `children`: process ids by service."""

    def __init__(self, tmp_path, key_prefix, *more):
        self.log = tmp_path / f"{key_prefix}.mcap"
        self.launcher = subprocess.Popen(
            arguments(tmp_path, key_prefix, "--speed", "1", *more),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        deadline = time.monotonic() + STARTED
        while not self._recorded() > 100 and self.launcher.poll() is None and time.monotonic() < deadline:
            time.sleep(0.1)
        assert self.launcher.poll() is None, self.launcher.stderr.read()
        self.children = participants(self.launcher.pid)
        assert set(self.children) >= SERVICES

    def _recorded(self):
        """Return the number of messages in the growing log."""
        if not self.log.exists():
            return 0
        try:
            with LogReader(self.log) as read:
                return sum(1 for _ in read.messages())
        except ValueError:
            return 0

    def end(self):
        """Return exit code and standard error; assert that only a readable log is left."""
        _, output = self.launcher.communicate(timeout=STARTED)
        self.assert_gone()
        assert self._recorded() > 100
        return self.launcher.returncode, output

    def assert_gone(self, seconds=END):
        deadline = time.monotonic() + seconds
        while alive := [name for name, pid in self.children.items() if running(pid)]:
            assert time.monotonic() < deadline, f"still there: {alive}"
            time.sleep(0.05)

    def whole(self):
        """Return True if the log is complete and its metadata has the right digest."""
        with LogReader(self.log) as read:
            return read.complete and read.digest() == read.metadata["digest"]

    def kill(self):
        for pid in [self.launcher.pid, *self.children.values()]:
            if running(pid):
                os.kill(pid, signal.SIGKILL)
        self.launcher.communicate()


@pytest.fixture
def started(tmp_path):
    if not Path("/proc/self/task").exists():
        pytest.skip("finds processes in /proc")
    runs = []
    former = signal.signal(signal.SIGHUP, signal.SIG_DFL)  # nohup ignores it, which processes inherit

    def start(key_prefix, *more):
        runs.append(Running(tmp_path, key_prefix, *more))
        return runs[-1]

    yield start
    signal.signal(signal.SIGHUP, former)
    for run in runs:
        run.kill()


def test_digest_is_equal_in_every_mode(tmp_path):
    alone = single(tmp_path)  # first, to compile the kernels of the processes
    first, second = (processes(tmp_path, key_prefix) for key_prefix in ("test-first", "test-second"))
    assert first["digest"] == second["digest"] == alone
    assert first["sim_time_s"] == pytest.approx(2.0)
    assert (first["scene"], first["seed"], first["mode"]) == ("hover", 1, "multi-process")
    assert set(first["rmse"]) == {"x", "y", "z", "roll", "pitch", "yaw"}
    with LogReader(tmp_path / "test-first.mcap") as log:
        assert log.digest() == first["digest"]
        assert log.attachments["scene.toml"] == SCENE.read_bytes()


def test_another_seed_changes_digest(tmp_path):
    wind = [*MISSION, "effects.random_wind_force={mean=[1.0, 0.0, 0.0], sigma=0.5}"]
    assert single(tmp_path, *wind, "run.seed=1") == single(tmp_path, *wind, "run.seed=1")
    assert single(tmp_path, *wind, "run.seed=1") != single(tmp_path, *wind, "run.seed=2")
    with LogReader(tmp_path / "single.mcap") as log:
        reported = [VehicleState.decode(payload).wind.x for *_, payload in log.messages(["/drone1/ground_truth"])]
    assert sum(reported) / len(reported) == pytest.approx(1.0, abs=0.1)  # the wind at the vehicle, not 0


def test_jacobi_digest_is_equal_in_both_modes(tmp_path):
    parallel = single(tmp_path, "communication.coupling=jacobi")
    assert processes(tmp_path, "test-parallel", "communication.coupling=jacobi")["digest"] == parallel
    assert parallel != single(tmp_path)


ENDED = [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)]


@pytest.mark.parametrize(("number", "code"), ENDED)
def test_signal_ends_all_processes_and_completes_log(started, number, code):
    run = started(f"test-{number.name}")
    requested = time.monotonic()
    run.launcher.send_signal(number)
    assert run.end() == (code, f"lapwing: ended by {number.name}\n")
    assert time.monotonic() - requested < END
    assert run.whole()


@pytest.mark.parametrize(
    ("victim", "number"),
    [
        ("plant", signal.SIGKILL),
        ("recorder", signal.SIGKILL),
        ("plant", signal.SIGTERM),
        ("trajectory", signal.SIGTERM),
    ],
)
def test_service_ended_by_signal_is_named_and_ends_run(started, victim, number):
    run = started(f"test-dead-{victim}")
    os.kill(run.children[victim], number)
    code, output = run.end()
    assert code == 1
    assert output.startswith(f"lapwing: {victim} ended unexpectedly (signal {number:d}) at t = ")
    assert output.count("\n") == 1
    assert run.whole() == (victim != "recorder")
    if number == signal.SIGTERM:
        with LogReader(run.log) as log:
            assert log.metadata["failure"] == f"{victim} was ended by SIGTERM"


def test_launcher_stopped_during_end_of_run_succeeds(started):
    run = started("test-paused", "--set", "run.duration=4", "--set", "success.require=[]")
    run.launcher.send_signal(signal.SIGSTOP)
    size, quiet = -1, 0
    while quiet < 20:  # services wait for the launcher at the end
        time.sleep(0.1)
        size, quiet = run.log.stat().st_size, quiet + 1 if run.log.stat().st_size == size else 0
    run.launcher.send_signal(signal.SIGCONT)
    assert run.end() == (0, "")
    assert run.whole()


def test_killed_recorder_loses_half_second_at_most(started):
    """Compare the recovered log with messages received before the kill; best of three, for a busy machine."""
    lost = []
    while len(lost) < 3 and min(lost, default=1.0) > 0.5:
        (door,) = loopback_endpoints(["door"]).values()
        prefix = f"test-recover{len(lost)}"
        run = started(prefix, "--listen", door, "--insecure")
        with ZenohBus(connect=[door], mode="client") as bus:
            clock = bus.subscribe(f"{prefix}/clock")
            received = clock.get(STARTED)[0]
            while newer := clock.get(0.0 if received > 3_000_000_000 else STARTED):
                received = newer[0]
            os.kill(run.children["recorder"], signal.SIGKILL)
        assert run.end()[0] == 1
        result = recover(run.log, run.log.with_suffix(".recovered.mcap"))
        lost.append((received - result.end_ns) * 1e-9)
        with LogReader(run.log.with_suffix(".recovered.mcap")) as log:
            assert log.complete
    assert min(lost) <= 0.5


def test_frozen_service_is_named_and_ends_run(started):
    run = started("test-frozen")
    os.kill(run.children["autopilot"], signal.SIGSTOP)
    code, output = run.end()
    assert code == 1
    assert output.startswith("lapwing: autopilot: stopped for ")
    assert output.count("\n") == 1
    assert run.whole()


def test_services_end_when_launcher_is_killed(started):
    run = started("test-orphans")
    run.launcher.kill()
    run.assert_gone()
    assert run.whole()


def test_user_error_at_start_of_service_is_one_line(tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        door = f"tcp/127.0.0.1:{taken.getsockname()[1]}"
        command = arguments(tmp_path, "test-door", "--listen", door, "--insecure")
        assert_rejected(run_command(*command[3:]), f"lapwing: router: cannot listen on {door}")
    assert not (tmp_path / "test-door.mcap").exists()
