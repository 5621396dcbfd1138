"""Other simulators beside the cases: where they are shown, and that nothing is missing without them."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from lapwing.cli.study_commands import stability
from lapwing.dynamics.lie.quaternion import Quaternion, rotation_matrix
from lapwing.studies.stability import cases, other_simulators
from lapwing.studies.stability.case_result import CaseResult, Plot, Row
from lapwing.studies.stability.case_runner import one
from lapwing.studies.stability.cases import toppling
from lapwing.studies.stability.other_simulators import _ball_feet

ROWS = [Row(name, "ours", "x", 1.0, "why", 0.5, "naive", 2.0) for name in ("first", "second")]


@pytest.fixture
def case(monkeypatch):
    monkeypatch.setattr(
        cases,
        "get",
        lambda name: SimpleNamespace(HARD="hard", run=lambda: CaseResult(ROWS, Plot("x", "y", [])), __name__=name),
    )


@pytest.mark.usefixtures("case")
def test_a_figure_stands_beside_its_row(monkeypatch, tmp_path, capsys):
    simulator = SimpleNamespace(CASES={"made_up": lambda: {"second": {"Made-up RK4": 0.25}}})
    monkeypatch.setattr(other_simulators.discovery, "names", lambda package: ["simulator"])
    monkeypatch.setattr(other_simulators.discovery, "get", lambda package, name, what: simulator)
    stability("made_up", json=tmp_path / "s.json", report=tmp_path / "s.html")
    first, second = json.loads((tmp_path / "s.json").read_text())["cases"]
    assert "other_simulators" not in first
    assert second["other_simulators"] == {"Made-up RK4": 0.25}
    assert "Made-up RK4: 0.25" in capsys.readouterr().out
    assert "Made-up RK4: 0.25" in (tmp_path / "s.html").read_text()


@pytest.mark.usefixtures("case")
def test_without_one_installed_its_place_is_empty(monkeypatch):
    def missing(package, name, what):
        raise ImportError(name)

    monkeypatch.setattr(other_simulators.discovery, "get", missing)
    assert other_simulators.figures("looping") == {}
    assert all(not row.other_simulators for row in one("made_up", False).found.rows)


@pytest.mark.parametrize(
    ("name", "package"), [("drake_sim", "pydrake"), ("exudyn_sim", "exudyn"), ("mujoco_sim", "mujoco")]
)
def test_they_measure_rows_of_cases(name, package):
    pytest.importorskip(package)
    simulator = other_simulators.discovery.get(other_simulators, name, "simulator")
    assert set(simulator.CASES) <= set(cases.names())
    loops = simulator.CASES["looping"]()["momentum"]
    assert loops
    assert max(loops.values()) < 1e-5  # three digits below the naive method: the same body, turning the same way


def test_four_bars_of_drake_turn_over_as_the_equation_of_motion_does():
    pytest.importorskip("pydrake")
    simulator = other_simulators.discovery.get(other_simulators, "drake_sim", "simulator")
    assert simulator.four_bars()["four_bar"][simulator.DISCRETE] < 0.05  # [m], of tips that move by 2 m


@pytest.mark.parametrize("axis", toppling.AXES)
@pytest.mark.parametrize("angle", [0.0, 0.4])
def test_a_vehicle_is_set_down_on_its_balls(axis, angle):
    height, attitude = _ball_feet.set_down(axis, angle)
    R = np.reshape(rotation_matrix(Quaternion(*attitude)), (3, 3))
    lowest = sorted(height + R[2] @ ball for ball in _ball_feet.BALLS)
    assert lowest[:2] == pytest.approx([_ball_feet.RADIUS] * 2, abs=1e-12)


@pytest.mark.parametrize("off", [0.0, 1e-3])
def test_the_edge_is_where_the_centre_of_mass_is_over_the_balls(off):
    def falls(axis, angle):
        _, attitude = _ball_feet.set_down(axis, angle - off)
        R = np.reshape(rotation_matrix(Quaternion(*attitude)), (3, 3))
        lowest = min(_ball_feet.BALLS, key=lambda ball: R[2] @ ball)
        return (R @ lowest)[1 - axis] * lowest[1 - axis] < 0.0  # on the other side of the centre of mass

    assert _ball_feet.error(falls) == pytest.approx(off, abs=1e-10)
