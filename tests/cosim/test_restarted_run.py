"""Whole runs whose services are killed in flight and started again: the digest is that of an undisturbed run."""

import json
import os
import signal
import subprocess

import pytest

from lapwing.cosim.log import LogReader
from lapwing.flight import Flight
from lapwing.runs.multi_process_run import fly_processes
from lapwing.runs.observer import Silent
from lapwing.services.process_main import ProcessSpec
from lapwing.services.scene_resolver import load, resolve
from lapwing.studies.simulate import fly
from tests.cosim.test_run import SCENE, STARTED, arguments, single, started  # noqa: F401 (a fixture)

pytestmark = pytest.mark.long

SHORT = ["run.duration=4", "success.require=[]"]


def sets(*overrides):
    return [part for override in [*SHORT, *overrides] for part in ("--set", override)]


def restarted(names):
    return f"run.restart={json.dumps(names)}"


@pytest.mark.parametrize(
    ("victims", "number", "named"),
    [
        (["plant"], signal.SIGKILL, ["plant"]),
        (["autopilot"], signal.SIGKILL, ["autopilot"]),
        (["trajectory"], signal.SIGKILL, True),
        (["plant", "autopilot", "trajectory"], signal.SIGKILL, True),
        (["autopilot"], signal.SIGSTOP, ["autopilot"]),
    ],
)
def test_a_service_that_is_killed_in_flight_takes_its_place_again(started, tmp_path, victims, number, named):  # noqa: F811
    alone = single(tmp_path, *SHORT)
    run = started("test-restart", *sets(restarted(named)))
    for name in victims:
        os.kill(run.children[name], number)
    assert run.end() == (0, "")
    assert run.whole()
    with LogReader(run.log) as log:
        assert log.digest() == alone
    told = [event.text for event in Flight.read(run.log).events if event.kind == "restart"]
    reason = "killed (signal 9)" if number == signal.SIGKILL else "stopped for 2.5 s"
    assert sorted(told) == [f"{name} was {reason}, and is started again" for name in sorted(victims)]


ALTITUDE = """
from lapwing.services.common.controller_api import ThrustAndMoments

class Altitude:
    rate = 125.0

    def __init__(self, vehicle):
        self.weight, self.steps = vehicle.mass * vehicle.gravity, 0

    def step(self, time, estimate, setpoint):
        self.steps += 1  # of which the next process must know
        p, v, w = estimate.position_world, estimate.velocity_world, estimate.omega_body
        climb = 60.0 * (setpoint.position_world[2] - p[2]) + 40.0 * (setpoint.velocity_world[2] - v[2])
        return ThrustAndMoments(self.weight + climb + 1e-6 * self.steps, (-3.0 * w[0], -3.0 * w[1], -3.0 * w[2]))
"""


def test_a_controller_in_python_is_where_it_was(tmp_path):
    (tmp_path / "own_altitude.py").write_text(ALTITUDE)
    scene = tmp_path / "hover.toml"
    scene.write_text(SCENE.read_text())
    own = 'autopilot.controller="own_altitude:Altitude"'
    assert struck(scene, tmp_path, {1.0: "autopilot"}, own) == fly(load(scene, [*SHORT, own])).digest


def test_all_services_of_a_mission_are_killed_one_after_another(tmp_path):
    kills = {1.0: "sensors", 1.6: "autopilot", 2.2: "trajectory", 2.8: "plant", 3.4: "sensors"}
    longer = "run.duration=16"  # as it hurries after each restart until it is on time again
    alone = fly(load("delivery_mission", [*SHORT, longer])).digest
    assert struck("delivery_mission", tmp_path, kills, longer) == alone


def test_whoever_is_killed_after_the_last_tick_holds_nobody_up(tmp_path):
    setup = resolve(load("hover", ["run.duration=1", "success.require=[]", restarted(["plant"])]))
    steps = [signal.SIGSTOP, signal.SIGCONT]  # of the recorder: the plant waits until that has all, and leaves

    def strike(watch):
        if steps and (watch.ended if steps[0] == signal.SIGCONT else watch.time_ns > 5e8):
            if watch.ended:
                os.kill(*children(os.getpid(), "plant"), signal.SIGKILL)
            os.kill(*children(os.getpid(), "recorder"), steps.pop(0))

    log = tmp_path / "struck.mcap"
    fly_processes(ProcessSpec("mission", setup, {}, "test-late", log=str(log), speed=1.0), Silent(), live=strike)
    assert not steps
    with LogReader(log) as read:
        assert read.digest() == fly(load("hover", ["run.duration=1", "success.require=[]"])).digest


def struck(scene, tmp_path, kills, *overrides):
    """Digest of a flight in which services are killed at times [s]."""
    names = sorted(set(kills.values()))
    setup = resolve(load(scene, [*SHORT, *overrides, restarted(names)]))
    left = sorted(kills.items())

    def strike(watch):
        if left and watch.time_ns > left[0][0] * 1e9 and watch.present >= set(setup.services):
            for pid in children(os.getpid(), left.pop(0)[1]):
                os.kill(pid, signal.SIGKILL)

    log = tmp_path / "struck.mcap"
    given = ProcessSpec("mission", setup, {}, "test-struck", log=str(log), speed=1.0)
    fly_processes(given, Silent(), live=strike)
    told = [event.text for event in Flight.read(log).events if event.kind == "restart"]
    assert told == [f"{name} was killed (signal 9), and is started again" for _, name in sorted(kills.items())]
    with LogReader(log) as read:
        return read.digest()


def test_a_service_that_is_killed_again_and_again_ends_the_run(started):  # noqa: F811
    run = started("test-restarts", *sets(restarted(["autopilot"])))
    while run.launcher.poll() is None:
        for pid in children(run.launcher.pid, "autopilot"):
            os.kill(pid, signal.SIGKILL)
    code, said = run.end()
    assert code == 1
    assert said.startswith("lapwing: autopilot ended unexpectedly (signal 9) at t = ")
    assert said.count("\n") == 1


def children(launcher, name):
    """Process ids of the participants `name` of a run."""
    found = subprocess.run(["pgrep", "-P", str(launcher), "-f", f"participant {name}$"], capture_output=True, text=True)
    return map(int, found.stdout.split())


def test_only_services_of_the_scene_can_be_started_again(tmp_path):
    command = arguments(tmp_path, "test-unknown", *sets(restarted(["sensors", "recorder"])))
    result = subprocess.run(command, capture_output=True, text=True, timeout=STARTED, check=False)
    assert result.returncode == 2
    expected = "services of this scene: plant, autopilot, trajectory"
    assert result.stderr == f"lapwing: run.restart: expected {expected}, got sensors, recorder\n"
