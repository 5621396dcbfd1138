"""Selection of integrator and step for an accuracy, and its cache."""

import json
import os
import random
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path
from typing import ClassVar

import pytest

from lapwing.cosim.scene import SceneError
from lapwing.services.common.schemas.run_schema import Run
from lapwing.services.plant.schema import Solver, method
from lapwing.services.scene_resolver import load
from lapwing.studies.accuracy import flight_accuracy, integrate, own_flight, scenes, solver_selection
from lapwing.studies.accuracy.work_precision import Point

ROOT = Path(__file__).parents[3]
BLOCKED = ROOT / "lapwing/scenes/gyrostat_blocked.toml"
OS4 = ROOT / "lapwing/scenes/os4_motors.toml"
POINTS = [
    Point("rkmk2", 2, "s", 0.004, 3e-4, 1e-5, 100, {}),
    Point("rkmk2", 2, "s", 0.002, 8e-5, 2e-5, 200, {}),
    Point("rkmk4", 4, "s", 0.004, 1e-7, 1.5e-5, 150, {}),
]


def scene(tmp_path, solver):
    """Return the path of an OS4 scene with another [solver] table."""
    text = (ROOT / "lapwing/scenes/os4_experiment_2.toml").read_text()
    head, _, rest = text.partition("[solver]")
    path = tmp_path / "os4.toml"
    path.write_text(f"{head}[solver]\n{solver}\n[communication]{rest.partition('[communication]')[2]}")
    return path


@pytest.fixture
def measured_titles(monkeypatch, tmp_path):
    """Replace measurements of manoeuvres by POINTS with an empty cache. Return the titles of the measured problems."""
    calls = []
    monkeypatch.setattr(solver_selection.own_flight, "has_known_commands", lambda scene: False)
    monkeypatch.setattr(solver_selection, "cache_folder", lambda: tmp_path / "cache")
    monkeypatch.setattr(
        solver_selection, "measure", lambda problem, most, timed: calls.append(problem.title) or list(POINTS)
    )
    return calls


class StubFlight(own_flight.OwnFlight):
    """Own flight in which RK4 has errors of fourth order, and others none that meets 1e-9 with a step of 4 ms."""

    calls: ClassVar[list] = []

    def __init__(self, scene, accuracy):
        self._scene, self.interval = scene, 0.004
        if scene[Run].duration > 100.0:
            raise ValueError("too long")

    def error(self, name, steps):
        self.calls.append((name, steps))
        size = {"rk4_renormalised": 1e-5, "rkmk54": 4e-6, "rk8_renormalised": 1e-8}[name]
        return size / steps ** integrate.integrators.get(name).ORDER


@pytest.fixture
def flown(measured_titles, monkeypatch):
    """Replace the own flight by a stub. Return its calls."""
    monkeypatch.setattr(solver_selection.own_flight, "has_known_commands", lambda scene: True)
    monkeypatch.setattr(solver_selection.own_flight, "OwnFlight", StubFlight)
    monkeypatch.setattr(StubFlight, "calls", [])
    return StubFlight.calls


@pytest.mark.parametrize(
    ("accuracy", "method", "steps"),
    [
        (2e-5, "rk4_renormalised", 1), (5e-6, "rkmk54", 1), (1e-6, "rk4_renormalised", 2),
        (1.3e-7, "rk8_renormalised", 1), (1e-9, "rk8_renormalised", 2),
    ],
)  # fmt: skip
def test_cheapest_solver_of_the_own_flight_is_selected(accuracy, method, steps, flown):
    """Steps are whole fractions of a communication step, not only halves; hopeless ones are not flown."""
    scene = load("hover", [f"solver.accuracy={accuracy}"])
    expected = [f'solver.integrator="{method}"', f"solver.step={0.004 / steps!r}"]
    assert solver_selection.overrides(scene, lambda text: None) == expected
    number = len(flown)
    assert number <= 6
    assert solver_selection.overrides(scene, lambda text: None) == expected
    assert len(flown) == number  # from the cache


def test_given_integrator_is_used_or_rejected_in_own_flight(flown):
    scene = ["solver.integrator=rk4_renormalised", "solver.accuracy"]
    assert solver_selection.overrides(load("hover", [scene[0], f"{scene[1]}=2e-7"]), lambda text: None)[1] == (
        f"solver.step={0.004 / 3!r}"
    )
    with pytest.raises(
        SceneError, match=r"1e-12: no method meets this error; the smallest error is 9.5e-12, .* at step 0.000125"
    ):
        solver_selection.overrides(load("hover", [scene[0], f"{scene[1]}=1e-12"]), lambda text: None)


def test_long_flight_selects_by_manoeuvres(flown, measured_titles):
    scene = load("hover", ["solver.accuracy=1e-4", "run.duration=1000"])
    assert solver_selection.overrides(scene, lambda text: None)
    assert len(measured_titles) == 3
    assert not flown


@pytest.mark.parametrize(
    ("overrides", "step"),
    [(["solver.accuracy=1e-3"], 0.004), (["solver.accuracy=1e-3", "solver.integrator=rkmk2"], 0.002)],
)
def test_scene_that_lands_gets_share_for_impacts(overrides, step, measured_titles, monkeypatch):
    """An impact amplifies previous errors; an integrator that cannot reach the share meets the accuracy."""
    points = [Point("rkmk2", 2, "s", 0.002, 9e-4, 1e-5, 1, {}), Point("rk4", 4, "s", 0.004, 2e-6, 1.5e-5, 2, {})]
    exact = [p._replace(error=1e-9) for p in points]
    monkeypatch.setattr(
        solver_selection, "measure", lambda problem, most, timed: points if "prescribed" in problem.title else exact
    )
    result = solver_selection.overrides(load(ROOT / "lapwing/scenes/hover.toml", overrides), lambda text: None)
    assert result[1] == f"solver.step={step!r}"


@pytest.mark.parametrize(("accuracy", "step"), [(1e-3, 0.004), (5e-4, 0.002), (1e-4, 0.002)])
def test_voltages_that_jump_count_with_their_share(accuracy, step, measured_titles, monkeypatch):
    gentle = [Point("rk4", 4, "s", h, 1e-12, 1e-5 / h, 1, {}) for h in (0.004, 0.002, 0.001)]
    jumping = [p._replace(error=error) for p, error in zip(gentle, (8e-5, 5e-6, 3e-7), strict=True)]
    monkeypatch.setattr(
        solver_selection, "measure", lambda problem, most, timed: jumping if "jumping" in problem.title else gentle
    )
    scene = load(ROOT / "lapwing/scenes/hover.toml", [f"solver.accuracy={accuracy}"])
    assert solver_selection.overrides(scene, lambda text: None)[1] == f"solver.step={step!r}"


def test_step_under_error_control_shows_no_error_of_other_flights(measured_titles, monkeypatch):
    """At 4 ms every step of a motor near its current limit had substeps, with less error than steps of 2 ms."""
    flights = {
        "prescribed": {0.004: 2e-12, 0.002: 2e-10, 0.001: 1e-11},
        "jumping": {0.004: 4e-7, 0.002: 2e-8, 0.001: 1e-9},
        "varying": {0.004: 4e-9, 0.002: 6e-6, 0.001: 9e-7},
    }

    def measure(problem, most, timed):
        errors = next(errors for name, errors in flights.items() if name in problem.title)
        return [Point("rk4", 4, "s", h, error, 1.0 / h, 1, {}) for h, error in errors.items()]

    monkeypatch.setattr(solver_selection, "measure", measure)
    for accuracy, step in (("1e-4", 0.002), ("1e-5", 0.001)):
        scene = load(ROOT / "lapwing/scenes/hover.toml", [f"solver.accuracy={accuracy}"])
        assert solver_selection.overrides(scene, lambda text: None)[1] == f"solver.step={step!r}"


def test_steps_finer_than_those_of_round_off_can_be_selected(measured_titles, monkeypatch):
    """A gentle flight of which 4 ms had an error of 2e-12 was not flown with finer steps, so none was selected."""
    gentle = [Point("rk4", 4, "s", 0.004, 2e-12, 1.0, 1, {})]
    jumping = [Point("rk4", 4, "s", h, error, 1.0, 1, {}) for h, error in ((0.004, 4e-7), (0.002, 2e-8))]
    monkeypatch.setattr(
        solver_selection, "measure", lambda p, most, timed: gentle if "prescribed" in p.title else jumping
    )
    scene = load(ROOT / "lapwing/scenes/hover.toml", ["solver.accuracy=1e-6"])
    assert solver_selection.overrides(scene, lambda text: None)[1] == "solver.step=0.002"


@pytest.mark.long
def test_fleet_has_one_solver_that_meets_accuracy_of_each_vehicle(measured_titles, monkeypatch):
    """Each airframe is measured once."""
    points = [Point("rk4", 4, "s", h, 1e-12, 1e-5 / h, 1, {}) for h in (0.004, 0.002, 0.001)]
    errors = iter([(1e-5, 5e-6, 3e-7), (4e-4, 2e-4, 1e-6)])
    by_problem = {}

    def measure(problem, most, timed):
        if "jumping" not in problem.title:
            return points
        key = problem.title, len(by_problem)
        by_problem[key] = next(errors)
        return [p._replace(error=error) for p, error in zip(points, by_problem[key], strict=True)]

    monkeypatch.setattr(solver_selection, "measure", measure)
    monkeypatch.setattr(flight_accuracy, "error_of_neighbours", lambda scene: 9e-5)
    scene = load(ROOT / "lapwing/scenes/formation.toml", ["solver.accuracy=1e-4", "vehicle.1.airframe=quad_x"])
    result = solver_selection.overrides(scene, lambda text: None)
    assert len(by_problem) == 2
    assert result == ['solver.integrator="rk4"', "solver.step=0.001"]
    resolved = load(scene, result)
    assert [method(vehicle)[2] for vehicle in resolved.vehicles] == [0.001] * 3


@pytest.mark.long
def test_warning_has_larger_error_between_vehicles_of_a_fleet_and_its_effects(measured_titles, monkeypatch):
    """No step reduces it. It is measured once, with the selected step; vehicles that do not interact have none."""
    steps, lines = [], []
    monkeypatch.setattr(
        flight_accuracy, "error_of_neighbours", lambda scene: steps.append(scene.vehicles[0][Solver].step) or 2e-3
    )
    for _ in range(2):
        assert solver_selection.overrides(load("formation", ["solver.accuracy=1e-3"]), lines.append)
    warnings = [line for line in lines if line.startswith("warning: solver.accuracy: collision, downwash between")]
    assert len(warnings) == 2
    assert "at 250 Hz, err by 0.002, above 0.001; no step reduces it" in warnings[0]
    assert steps == [0.004]
    lines.clear()
    assert solver_selection.overrides(load("fleet", ["solver.accuracy=1e-3"]), lines.append)
    assert not any("warning" in line for line in lines)


def test_fleet_with_step_of_one_vehicle_selects_none(measured_titles):
    overrides = ["solver.accuracy=1e-4", "vehicle.1.solver.step=0.002"]
    scene = load(ROOT / "lapwing/scenes/formation.toml", overrides)
    assert solver_selection.overrides(scene, lambda text: None) == []
    assert not measured_titles


@pytest.mark.parametrize(
    ("solver", "overrides"),
    [
        ("accuracy = 1e-4", ['solver.integrator="rkmk4"', "solver.step=0.004"]),
        ("accuracy = 1e-3", ['solver.integrator="rkmk2"', "solver.step=0.004"]),
        ('accuracy = 1e-4\nintegrator = "rkmk2"', ['solver.integrator="rkmk2"', "solver.step=0.002"]),
        ("accuracy = 1e-4\nstep = 0.001", []),
        ("step = 0.001", []),
    ],
)
def test_cheapest_that_meets_accuracy_is_set(solver, overrides, measured_titles, tmp_path):
    path = scene(tmp_path, solver)
    result = solver_selection.overrides(load(path), lambda text: None)
    assert result == overrides
    resolved = load(path, result)
    assert not resolved[Solver].undecided
    method(resolved)


@pytest.mark.parametrize(
    ("solver", "names"),
    [
        ("accuracy = 1e-4", ["rk4_renormalised", "rk8_renormalised", "rkmk2", "rkmk54"]),
        ('accuracy = 1e-4\nintegrator = "rkmk2"', ["rkmk2"]),
        ('accuracy = 1e-4\nintegrator = "cf4"', ["cf4"]),
    ],
)
def test_only_candidates_are_compiled(solver, names, measured_titles, monkeypatch, tmp_path):
    """Each integrator takes seconds to compile, and the others are never the cheapest."""
    problems = []
    points = [Point(name, 4, "s", 0.004, 1e-9, 1e-5, 1, {}) for name in names]
    monkeypatch.setattr(solver_selection, "measure", lambda problem, most, timed: problems.append(problem) or points)
    solver_selection.overrides(load(scene(tmp_path, solver)), lambda text: None)
    assert sorted(method.name for method in problems[0].methods) == names


def test_selection_is_measured_once_per_physics(measured_titles, tmp_path):
    path, output = scene(tmp_path, "accuracy = 1e-4"), []
    first = solver_selection.overrides(load(path), output.append)
    assert solver_selection.overrides(load(path), output.append) == first
    solver_selection.overrides(load(path, ["solver.accuracy=1e-3"]), output.append)
    assert len(measured_titles) == len(output) == 1
    solver_selection.overrides(load(path, ["os4.mass=0.7"]), output.append)
    assert len(measured_titles) == 2


def test_damaged_or_read_only_cache_is_ignored(measured_titles, monkeypatch, tmp_path):
    path = scene(tmp_path, "accuracy = 1e-4")
    first = solver_selection.overrides(load(path), lambda text: None)
    (cache_file,) = (tmp_path / "cache" / "accuracy").glob("*.json")
    for damage in (b"\xff", b"[{}]", b"[1", b"7", b"[]"):
        cache_file.write_bytes(damage)
        assert solver_selection.overrides(load(path), lambda text: None) == first
    assert len(measured_titles) == 6
    monkeypatch.setattr(solver_selection, "cache_folder", lambda: Path("/dev/null/none"))
    assert solver_selection.overrides(load(path), lambda text: None) == first


def test_unreachable_accuracy_and_default_are_reported(measured_titles, tmp_path):
    path = scene(tmp_path, "accuracy = 1e-12")
    with pytest.raises(ValueError, match=r"os4.toml: solver.accuracy: 1e-12: no method meets .* 1e-07, by rkmk4"):
        solver_selection.overrides(load(path), lambda text: None)
    with pytest.raises(
        ValueError, match=r"os4.toml: solver.accuracy: no solver is selected; override solver.integrator"
    ):
        method(load(path))
    with pytest.raises(SceneError, match=r"solver.accuracy: expected a number at least 1e-12, got 0"):
        load(path, ["solver.accuracy=0"])


@contextmanager
def hindered(monkeypatch):
    """Make clocks jump, and share one core with busy processes."""
    cores, generator = os.sched_getaffinity(0), random.Random(1)
    os.sched_setaffinity(0, {min(cores)})
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(3)]
    try:
        with monkeypatch.context() as patch:
            for clock in ("perf_counter", "monotonic", "process_time", "thread_time", "time"):
                patch.setattr(time, clock, lambda: generator.uniform(-1e6, 1e6))
            yield
    finally:
        for process in busy:
            process.kill()
            process.wait()
        os.sched_setaffinity(0, cores)


@pytest.mark.long
def test_selection_for_own_flight_is_equal_on_a_busy_machine(monkeypatch, tmp_path):
    """It includes the landing, which amplifies errors, and is met in the closed loop."""
    monkeypatch.setattr(solver_selection, "cache_folder", lambda: tmp_path)
    scene = load("hover", ["solver.accuracy=1e-6", "run.duration=12"])
    result = solver_selection.overrides(scene, lambda text: None)
    (cached,) = (tmp_path / "accuracy").glob("*.json")
    idle = cached.read_bytes()
    cached.unlink()
    with hindered(monkeypatch):
        assert solver_selection.overrides(scene, lambda text: None) == result
    assert cached.read_bytes() == idle
    selected = flight_accuracy.measure(load(scene, result), lambda config, text, work: work(lambda tick: None))
    assert selected.met


@pytest.mark.long
def test_selection_by_real_measurement_is_equal_on_a_busy_machine(monkeypatch, tmp_path):
    """On a busy machine an accuracy was refused, or met by another integrator and step."""
    monkeypatch.setattr(solver_selection, "cache_folder", lambda: tmp_path)
    names = ["lie_euler", "erk4m", "rkmk4"]  # each is compiled
    monkeypatch.setattr(integrate.integrators, "compatible_methods", lambda p, x: names)
    path = scene(tmp_path, "accuracy = 1e-6")
    result = solver_selection.overrides(load(path), lambda text: None)
    (points,) = json.loads(next((tmp_path / "accuracy").glob("*.json")).read_text())
    (overrides,) = [
        p for p in points if result == [f'solver.integrator="{p["method"]}"', f"solver.step={p['setting']!r}"]
    ]
    assert overrides["error"] <= 1e-6
    assert overrides["evaluations"] == min(p["evaluations"] for p in points if p["error"] <= 1e-6)
    (cached,) = (tmp_path / "accuracy").glob("*.json")
    idle = cached.read_bytes()
    cached.unlink()
    with hindered(monkeypatch):
        assert solver_selection.overrides(load(path), lambda text: None) == result
    assert cached.read_bytes() == idle


def test_model_that_cannot_be_measured_is_named(monkeypatch):
    other = load(OS4)
    monkeypatch.delattr("lapwing.services.plant.models.os4.system")
    with pytest.raises(ValueError, match=r"os4_motors.toml: vehicle.model: the integrators of os4 cannot be compared"):
        scenes.problem(other)
