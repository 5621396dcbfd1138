"""Stability cases in other simulators: measured rows, and missing packages."""

from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks import _simulators, stability
from benchmarks._simulators import _cases
from lapwing.dynamics import discovery
from lapwing.dynamics.lie.quaternion import Quaternion, rotation_matrix
from lapwing.studies.stability import cases
from lapwing.studies.stability.cases import toppling


def test_errors_of_installed_simulators_are_printed(monkeypatch, capsys):
    simulator = SimpleNamespace(CASES={"exact_time": lambda: {row: {"Made-up RK4": 0.25}}})
    row = cases.get("exact_time").run().rows[0].name
    monkeypatch.setattr(_simulators, "installed", lambda: [simulator])
    assert stability.errors("exact_time") == {row: {"Made-up RK4": 0.25}}
    stability.main(["exact_time"])
    assert "Made-up RK4" in capsys.readouterr().out


def test_simulators_that_are_not_installed_are_skipped(monkeypatch, capsys):
    def missing(package, name, what):
        raise ImportError(name)

    monkeypatch.setattr(_simulators.discovery, "get", missing)
    assert stability.errors("looping") == {}
    assert "mujoco_sim: skipped" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("name", "package"), [("drake_sim", "pydrake"), ("exudyn_sim", "exudyn"), ("mujoco_sim", "mujoco")]
)
def test_simulators_measure_rows_of_cases(name, package):
    pytest.importorskip(package)
    simulator = discovery.get(_simulators, name, "simulator")
    assert set(simulator.CASES) <= set(cases.names())
    loops = simulator.CASES["looping"]()["momentum"]
    assert loops
    assert max(loops.values()) < 1e-5  # three digits below the baseline method: the same body, turning the same way


def test_drake_four_bars_follow_equation_of_motion():
    pytest.importorskip("pydrake")
    simulator = discovery.get(_simulators, "drake_sim", "simulator")
    assert simulator.four_bars()["four_bar"][simulator.DISCRETE] < 0.05  # [m], of tips that move by 2 m


@pytest.mark.parametrize("axis", toppling.AXES)
@pytest.mark.parametrize("angle", [0.0, 0.4])
def test_set_down_vehicle_touches_with_two_balls(axis, angle):
    height, attitude = _cases.set_down(axis, angle)
    R = np.reshape(rotation_matrix(Quaternion(*attitude)), (3, 3))
    lowest = sorted(height + R[2] @ ball for ball in _cases.BALLS)
    assert lowest[:2] == pytest.approx([_cases.RADIUS] * 2, abs=1e-12)


@pytest.mark.parametrize("off", [0.0, 1e-3])
def test_toppling_edge_is_below_centre_of_mass(off):
    def falls(axis, angle):
        _, attitude = _cases.set_down(axis, angle - off)
        R = np.reshape(rotation_matrix(Quaternion(*attitude)), (3, 3))
        lowest = min(_cases.BALLS, key=lambda ball: R[2] @ ball)
        return (R @ lowest)[1 - axis] * lowest[1 - axis] < 0.0  # on the other side of the centre of mass

    assert _cases.toppling_error(falls) == pytest.approx(off, abs=1e-10)
