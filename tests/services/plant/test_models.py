"""Plant models other than multirotors: a scene's motion is bit-for-bit that of the library."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from lapwing.cosim.run_errors import LockStepError
from lapwing.cosim.scene import SceneError
from lapwing.dynamics.integrators import get, simulate
from lapwing.messages import stamp_ns
from lapwing.services.plant.models import gyrostat, os4
from lapwing.services.scene_resolver import load
from tests.cosim import memory_log

pytestmark = pytest.mark.long

SCENES = Path(__file__).parents[3] / "lapwing/scenes"
SATELLITE, OS4 = SCENES / "gyrostat_feedback.toml", SCENES / "os4_experiment_3.toml"
LOAD, CRATE = SCENES / "cooperative_load.toml", SCENES / "unload.toml"


def ticks(scene, count):
    """Return the true states at the first `count` ticks of a scene without control."""
    return memory_log.fly(scene, last=count - 1).messages("ground_truth")


@pytest.mark.parametrize(("path", "model"), [(SATELLITE, gyrostat), (OS4, os4)])
def test_scene_motion_equals_library(path, model):
    scene = load(path)
    count, solver = 20, scene.lookup("solver")
    steps = round(1.0 / scene.lookup("communication.rate") / solver.step)
    p, start = model.system(scene)
    _, rows = simulate(get(solver.integrator), p, start, solver.step, count * steps, every=steps)
    for row, truth in zip(rows, ticks(scene, count + 1), strict=True):
        q = truth.pose.orientation
        first = 0 if model is gyrostat else 3
        assert (q.w, q.x, q.y, q.z) == tuple(row[first : first + 4])


def test_satellite_reaches_its_attitude():
    scene = load(SCENES / "gyrostat_attitude.toml")
    truth = ticks(scene, 7201)[-1]
    half = np.linalg.norm((0.6, -0.9, 1.1)) / 2
    axis = np.array((0.6, -0.9, 1.1)) / (2 * half)
    q = truth.pose.orientation
    assert (q.w, q.x, q.y, q.z) == pytest.approx((np.cos(half), *(np.sin(half) * axis)), abs=1e-6)


def test_experiments_3_and_4_follow_published_forces():
    falls = [ticks(load(SCENES / f"os4_experiment_{n}.toml"), 751)[-1].acceleration.z for n in (3, 4)]
    assert falls[1] < falls[0] < 0.0


def test_motors_reach_speed_at_which_torque_and_drag_balance():
    scene = load(SCENES / "os4_motors.toml")
    speed = ticks(scene, 751)[-1].rotor_speed[0]
    current = (5.8 - 0.0205 * speed) / 0.6
    assert 0.0205 * current == pytest.approx(7.5e-7 * speed**2, rel=1e-6)


def formation_steps(scene, count):
    """Return (bodies, lift) of each tick; plant and control step alternately."""
    flight = memory_log.fly(scene, last=count - 1)
    return list(zip(flight.messages("body_states"), flight.messages("rotor_wrench"), strict=True))


def formation_of_three(path):
    """Return the formation with a third quadrotor."""
    text = LOAD.read_text()
    text = text.replace("[0.755, 0.755]", "[0.755, 0.755, 0.6]").replace("[0.6, 0.8]", "[0.6, 0.8, 0.7]")
    text = text.replace("0.1377]]", "0.1377], [0.0820, 0.0845, 0.1377]]")
    lines = [
        line.replace("]]", "], [0.0, 0.6, -0.8]]") if line.startswith("link_") and "[[" in line else line
        for line in text.splitlines()
    ]
    path.write_text("\n".join(lines))
    return load(path)


@pytest.mark.parametrize("number", [2, 3])
def test_links_keep_their_lengths_and_load_its_path(number, tmp_path):
    scene = load(LOAD) if number == 2 else formation_of_three(tmp_path / "three.toml")
    flight = formation_steps(scene, 2001)
    lengths = scene.lookup("cooperative_load.link_length")
    for bodies, _ in flight[::50]:
        places = [np.array(p.position) for p in bodies.pose]
        assert [np.linalg.norm(places[0] - q) for q in places[1:]] == pytest.approx(lengths, abs=1e-14)
    bodies, lift = flight[-1]
    assert stamp_ns(bodies.header) == 5_000_000_000
    assert tuple(bodies.pose[0].position) == pytest.approx((2.5, 0.0, 0.75), abs=2e-3)
    assert len(lift.thrust) == number


def test_formation_is_equal_in_processes_and_single_process(tmp_path):
    digests = set()
    for mode in ("multi-process", "single-process"):
        figures = tmp_path / f"{mode}.json"
        command = [sys.executable, "-m", "lapwing", "run", str(LOAD), "--mode", mode, "--set", "run.duration=0.5"]
        command += ["--json", str(figures), "--log", str(tmp_path / f"{mode}.mcap"), "--key-prefix", "test-formation"]
        subprocess.run(command, check=True, timeout=300, capture_output=True)
        digests.add(json.loads(figures.read_text())["digest"])
    assert len(digests) == 1


WRONG = {
    "no such model": (
        SATELLITE,
        "vehicle.model=gyro",
        "vehicle.model: unknown model 'gyro'; did you mean gyrostat? expected one of",
    ),
    "another model's table": (SATELLITE, "vehicle.model=os4", "os4: missing; expected a table [os4], which the mod"),
    "effects": (SATELLITE, "effects.gravity={}", "effects: the model gyrostat has no such table"),
    "no rotation": (
        SATELLITE,
        "gyrostat.initial_attitude=[1.0, 0.1, 0.0, 0.0]",
        "attitude is not a rotation, off its manifold by 0.00",
    ),
    "no inertia": (SATELLITE, "gyrostat.inertia=[500.0, 0.0, 1000.0]", "above 0, got 0 about y"),
    "not for this state": (OS4, "solver.integrator=rigid_splitting", "it is for states of attitude and omega_body"),
    "a link of no length": (LOAD, "cooperative_load.link_length=[0.6, 0.0]", "link_length[1] = 0: must be positive"),
    "a link that is no unit vector": (LOAD, "cooperative_load.link_start=[[0, 0, -2], [1, 0, 0]]", "off its manifold"),
    "a link of no direction": (LOAD, "cooperative_load.link_start=[[0, 0, 0], [1, 0, 0]]", "not a direction, all zero"),
    "no number": (SATELLITE, "gyrostat.damping=nan", "gyrostat.damping: expected a finite number, got nan"),
    "a step below zero": (OS4, "solver.step=-0.001", "solver.step: expected a number at least 1e-09 [s], got -0.001"),
    "a direction of nothing": (LOAD, "formation.link_direction=[[0, 0, 0], [1, 0, 0]]", "2 non-zero directions"),
    "too few directions": (LOAD, "formation.link_direction=[[1, 0, 0]]", "formation.link_direction: expected 2"),
    "a pack that does not fit": (CRATE, "unloading.depth=0.15", "unloading.pack_size: expected a pack that fits"),
    "friction that grows": (CRATE, "unloading.door_friction=[0.1, 0.2]", "expected [static, dynamic] with 0 < dyn"),
    "a step of zero": (OS4, "solver.step=0", "solver.step: expected a number at least 1e-09"),
    "control slower than the exchange": (
        LOAD,
        "rates.body_states=100",
        "rates.body_states: expected communication.rate = 400 Hz",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_invalid_scene_error_names_key(name):
    path, override, message = WRONG[name]
    with pytest.raises(SceneError) as error:
        load(path, [override])
    assert message in str(error.value)


def test_divergence_error_names_value_and_time():
    scene = load(
        OS4, ["solver.step=0.004", "os4.translational_drag=[1e4, 1e4, 1e4]", "os4.rotor_speed_rpm=[9e3, 0, 0, 0]"]
    )
    with pytest.raises(LockStepError, match=r"os4: not finite at t = [\d.]+ s: \w+.*use a smaller step than 0.004 s"):
        ticks(scene, 5000)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("hover", "does not fit the model rigid_body: it is for states of attitude and omega_body"),
        ("gyrostat_feedback", "does not fit the model gyrostat: it is for a torque that does not depend on the rate"),
    ],
)
def test_unsuitable_integrator_error_lists_suitable(name, message):
    with pytest.raises(SceneError, match=rf"solver.integrator: rigid_splitting {message}") as error:
        load(name, ["solver.integrator=rigid_splitting"])
    assert "expected one of cf4, " in str(error.value)
    assert "rigid_splitting" not in str(error.value).partition("expected")[2]
    load("gyrostat_blocked", ["solver.integrator=rigid_splitting"])
