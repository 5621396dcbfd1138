"""Accuracy study of scalar problems with known errors and work, and its command."""

import itertools
import json
import time

import numpy as np
import pytest
from matplotlib.figure import Figure

from lapwing.studies.accuracy.error_budget import SOURCES
from lapwing.studies.accuracy.problem import Problem, SolverMethod, SolverRun
from lapwing.studies.accuracy.targets import find, scene_of
from lapwing.studies.accuracy.work_precision import Point, cheapest, check_target, measure, pareto_points
from lapwing.views.studies import accuracy_command
from lapwing.views.studies import accuracy_command as console_output
from lapwing.views.studies.accuracy_plot import LABEL, draw, draw_points
from lapwing.views.terminal import console


def decay():
    """Return x' = -x up to t = 1 under Euler's method, and a method that always fails."""

    def euler(h):
        x = 1.0
        for _ in range(round(1.0 / h)):
            x -= h * x
        return x

    def read(h, x):
        return SolverRun(np.array([0.0, 1.0]), np.array([[1.0], [x]]), 0.0, round(1.0 / h))

    steps = [0.1 / 2**k for k in range(5)]
    methods = [
        SolverMethod("euler", 1, "s", steps, lambda h: lambda: euler(h), read, lambda: None),
        SolverMethod("broken", 1, "s", steps, lambda h: lambda: None, lambda h, x: None, lambda: None),
    ]
    value = {"value": lambda t, y: y[:, 0]}
    return Problem("decay", 1.0, methods, lambda: np.array([np.exp(-1.0)]), "closed form", value)


def test_measured_errors_equal_closed_form():
    points = measure(decay())
    assert [p.method for p in points] == ["euler"] * 5
    for p in points:
        exact = np.exp(-1.0)
        assert p.error == pytest.approx(abs((1 - p.setting) ** (1 / p.setting) - exact) / (1 + exact), rel=1e-9)
        assert p.evaluations == round(1.0 / p.setting)
        assert p.drift["value"] == pytest.approx(1 - (1 - p.setting) ** (1 / p.setting))
        assert p.time > 0.0


def points():
    drift = {"manifold": 0.0}
    return [
        Point("one", 4, "s", 0.1, 1e-3, 1e-5, 40, drift),
        Point("one", 4, "s", 0.05, 6e-5, 2e-5, 80, drift),
        Point("two", 5, "tol", 1e-6, 5e-7, 3e-5, 90, drift),
        Point("two", 5, "tol", 1e-3, 5e-4, 2.5e-5, 50, drift),
    ]


def test_cheapest_that_meets_target_is_named():
    assert cheapest(points(), 1e-3).setting == 0.1
    assert cheapest(points(), 2e-4).setting == 0.05
    assert cheapest(points(), 1e-6).method == "two"
    with pytest.raises(
        ValueError, match=r"--target 1e-09: no method meets this error; the smallest error is 5e-07, by two"
    ):
        cheapest(points(), 1e-9)
    assert [p.setting for p in pareto_points(points(), [1e-2, 1e-4])] == [0.1, 0.05, 1e-3, 1e-6]


def oscillator(seconds=0.0):
    """Return a problem with two methods of known error, whose runs sleep for `seconds`."""

    def solver_method(name, order, stages):
        def read(h, result):
            end = np.array([1.0 + h**order])
            return SolverRun(np.array([0.0, 1.0]), np.array([[1.0], end]), 0.0, stages * round(1.0 / h))

        steps = [0.25 / 2**k for k in range(12)]
        return SolverMethod(name, order, "s", steps, lambda h: lambda: time.sleep(seconds), read, lambda: None)

    methods = [solver_method("second", 2, 2), solver_method("fourth", 4, 4)]
    return Problem("powers", 1.0, methods, lambda: np.array([1.0]), "closed form")


def test_points_and_choice_do_not_depend_on_the_clock(monkeypatch):
    """A run of more than 0.1 s ended the refinement, and the fastest point by stopwatch was chosen."""
    expected = measure(oscillator(), timed=False)
    generator, count = np.random.default_rng(1), itertools.count()
    stopped, backwards, slow = lambda: 7.0, lambda: -1e3 * next(count), lambda: 1e4 * next(count)
    for reading in (stopped, backwards, slow, lambda: float(generator.uniform(-1e6, 1e6))):
        for clock in ("perf_counter", "monotonic", "process_time", "thread_time", "time"):
            monkeypatch.setattr(time, clock, reading)
        points = measure(oscillator())
        assert [p[:5] + p[6:8] for p in points] == [p[:5] + p[6:8] for p in expected]
        assert [cheapest(points, goal)[:4] for goal in (1e-1, 1e-3, 1e-6)] == [
            ("second", 2, "s", 0.25), ("fourth", 4, "s", 0.125), ("fourth", 4, "s", 2.0**-5),
        ]  # fmt: skip


def test_budget_of_a_run_is_evaluations():
    points = measure(oscillator(), most=100, timed=False)
    assert [p.evaluations for p in points] == [8, 16, 32, 64, 128, 16, 32, 64, 128]


@pytest.mark.parametrize("goal", [0.0, -1e-3, float("nan"), float("inf")])
def test_invalid_error_goal_is_rejected(goal):
    with pytest.raises(ValueError, match=r"--target .*: expected an error above 0"):
        check_target(goal)


def test_misspelt_target_lists_choices():
    with pytest.raises(
        ValueError, match=r"problem 'gyrostat_bloked'; did you mean gyrostat_blocked\? expected .* problems .*free"
    ):
        find("gyrostat_bloked")


def test_problem_name_precedes_scene_name():
    assert scene_of("delivery_paper", ["solver.step=0.002"]).lookup("solver.step") == 0.002
    assert scene_of("gyrostat_blocked", []) is None
    assert scene_of("lapwing/scenes/gyrostat_blocked.toml", []).name == "gyrostat_blocked"


def test_json_and_picture(tmp_path):
    study = accuracy_command.Study("decay", decay(), points(), 1e-4, points()[1], [], None, None, None)
    accuracy_command.write_json(tmp_path / "a.json", study)
    data = json.loads((tmp_path / "a.json").read_text())
    assert data["cheapest"]["method"] == "one"
    assert data["points"][2] == {
        "method": "two", "order": 5, "unit": "tol", "setting": 1e-6, "error": 5e-7, "time": 3e-5, "evaluations": 90,
        "drift": {"manifold": 0.0}, "spread": [None, None],
    }  # fmt: skip
    assert accuracy_command.answer(study) == (
        "0.0001: one at 50 ms (error 6.0e-05), 0.02 ms of CPU time for 1 s, 80 evaluations, the fewest; "
        "ten times more accurate costs 1.1 times as much"
    )
    same = study._replace(points=[*points()[:2], points()[1]._replace(error=6e-6)])
    assert accuracy_command.answer(same).endswith("; ten times more accurate costs no more")
    fast, slow = (
        points()[1]._replace(method="fast", spread=(5e-6, 6e-6), time=5e-6),
        points()[1]._replace(spread=(2e-5, 2e-5)),
    )
    timed = accuracy_command.answer(study._replace(points=[slow, fast], selected=slow))
    assert "80 evaluations, the fewest; fast at 50 ms took 75 % less time; " in timed
    draw(tmp_path / "a.png", "decay", points(), goal=1e-4, selected=points()[1])
    assert (tmp_path / "a.png").read_bytes()[:4] == b"\x89PNG"


@pytest.mark.long
def test_command_prints_cheapest_method(capsys, tmp_path, monkeypatch):
    problem = find("os4_experiment_1")
    few = [method for method in problem.methods if method.name in ("rkmk54", "lie_euler", "erk4m")]  # each is compiled
    monkeypatch.setattr(accuracy_command, "find", lambda target: problem._replace(methods=few))
    said = []
    result = accuracy_command.study("os4_experiment_1", [], 1e-3, lambda *parts: said.append(parts))
    assert [(done, total) for _, done, total in said] == [(k, len(few) + 2) for k in (0, *range(len(few) + 2))]
    accuracy_command.show(console(120), result)
    accuracy_command.write_json(tmp_path / "a.json", result)
    printed = capsys.readouterr().out
    assert "OS4 quadrotor: experiment 1" in printed
    assert any(line.startswith("0.001: ") for line in printed.splitlines()[:2])  # behind progress, if it took a while
    result = json.loads((tmp_path / "a.json").read_text())
    assert result["cheapest"]["error"] <= 1e-3
    assert {"rkmk54", "lie_euler", "erk4m"} == {p["method"] for p in result["points"]}


@pytest.mark.long
def test_scene_with_contact_has_error_sources_and_cost(capsys, monkeypatch):
    problem_of = accuracy_command.scenes.problem

    def two_methods(scene):
        problem = problem_of(scene)
        return problem._replace(methods=[m for m in problem.methods if m.name in ("rk4_renormalised", "rkmk4")])

    monkeypatch.setattr(accuracy_command.scenes, "problem", two_methods)
    result = accuracy_command.study("hover", ["run.duration=0.2", "solver={accuracy=1e-3}"], None)
    accuracy_command.show(console(120), result)
    assert result.selected[:4] == ("rk4_renormalised", 4, "s", 0.004)
    assert min(result.cost) > 0.0
    assert {part.source for part in result.parts} == set(SOURCES)
    printed = capsys.readouterr().out
    assert "0.001: rk4_renormalised at 4 ms in the flight, as solver.accuracy selects (" in printed
    assert "the flight errs most by its communication step (250 Hz): " in printed
    assert "in contact" in printed


def test_table_fits_80_columns(capsys):
    drift = dict.fromkeys(("manifold", "energy", "vertical momentum"), 1.23e-123)
    wide = Point("implicit_lie_midpoint", 2, "s", 5.7220458984375e-05, 3.2e-13, 0.15, 12_345_678, drift)
    console_output.show_points(console(80), decay(), [wide])
    output = capsys.readouterr().out
    assert max(map(len, output.splitlines())) <= 80
    assert "…" not in output
    assert "0.0572 ms" in output
    assert "12345678" in output


def test_labels_of_curves_that_end_together_are_apart():
    axes = Figure().subplots()
    names = [f"method{k}" for k in range(6)]
    points = [Point(name, 4, "s", h, 1e-6 * h**4, 1e-4 / h, round(1.0 / h), {}) for name in names for h in (1.0, 0.1)]
    draw_points(axes, points, 1e-6, None)
    heights = sorted(text.xyann[1] for text in axes.texts if text.get_text() in names)
    assert len(heights) == 6
    assert min(np.diff(heights)) > 0.99 * LABEL
    assert heights[0] >= 0.0


def test_cheapest_method_at_each_error_has_a_name():
    names = [f"method{k}" for k in range(8)]
    points = [Point(name, 4, "s", 0.1, 1e-3 * 10.0**-k, 1e-4, 100 + k, {}) for k, name in enumerate(names)]
    points += [Point("dear", 8, "s", 0.1, 1e-12, 1e-2, 1000, {})]
    axes = Figure().subplots()
    draw_points(axes, points, 1e-3, points[0], "fewest evaluations")
    assert {"method0, fewest evaluations", "dear"} < {text.get_text() for text in axes.texts}
