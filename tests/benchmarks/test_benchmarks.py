"""Benchmarks: help, soak, other simulators."""

import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks import _simulators, stability
from benchmarks._simulators import _cases
from benchmarks.soak import Sample, rows
from lapwing.dynamics import discovery
from lapwing.dynamics.lie.quaternion import Quaternion, rotation_matrix
from lapwing.studies.stability import cases
from lapwing.studies.stability.cases import toppling
from tests.combinations import rest_nightly

FOLDER = Path(__file__).parents[2] / "benchmarks"
DEFINED = {path.stem for path in FOLDER.glob("[a-z]*.py")} | {path.parent.name for path in FOLDER.glob("*/__main__.py")}


def benchmark(name: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", f"benchmarks.{name}", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)


@pytest.mark.long
@pytest.mark.parametrize("name", rest_nightly(*sorted(DEFINED), keep=5))
def test_help_describes_benchmark_without_measurement(name):
    if name == "fmu_coupling":
        pytest.importorskip("fmpy")
    if name == "environments":
        pytest.importorskip("gymnasium")
    result = benchmark(name, "--help")
    assert (result.returncode, result.stderr) == (0, "")
    assert result.stdout.strip().startswith(f"Usage: python -m benchmarks.{name} [OPTIONS]")
    source = FOLDER / f"{name}.py" if (FOLDER / f"{name}.py").exists() else FOLDER / name / "__init__.py"
    described = source.read_text(encoding="utf-8").split('"""')[1].splitlines()
    assert all(line.strip() in result.stdout for line in described)
    assert len(result.stdout.splitlines()) < len(described) + 20  # the description and the options


@pytest.mark.parametrize(
    ("name", "arguments", "expected"),
    [
        ("mission", ["--repeats", "many"], "Invalid value for '--repeats'"),
        ("startup_time", ["--repeat", "3"], "No such option: --repeat"),
        ("landings", ["--kind", "soft"], "'soft' is not one of"),
        pytest.param("__main__", ["missions"], "unknown benchmark missions", marks=pytest.mark.long),
    ],
)
def test_wrong_argument_is_named(name, arguments, expected):
    result = benchmark(name, *arguments)
    assert result.returncode == 2
    assert expected in result.stderr
    assert "Traceback" not in result.stderr


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


def samples(slower, dearer):
    """Return 41 samples; in the last quarter, wall time is `slower` and processor time `dearer` by these factors."""
    result, wall, processor = [], 0.0, 0.0
    for k in range(41):
        result.append(Sample(wall, float(k), 1000.0, 90, 40, processor, 0.15 * k))
        late = k >= 30
        wall, processor = wall + 0.1 * (slower if late else 1.0), processor + 0.2 * (dearer if late else 1.0)
    return result


@pytest.mark.parametrize(
    ("slower", "dearer", "short"),
    [
        (1.0, 1.0, []),
        (1.25, 1.0, ["speed, to the first"]),
        (1.0, 1.25, ["processor time", "processor time, to the first"]),
        (0.5, 0.5, []),
    ],
)
def test_run_that_becomes_slow_falls_short(slower, dearer, short):
    result = {row.name.removeprefix("flight: "): row for row in rows(samples(slower, dearer), "flight")}
    assert [what for what, row in result.items() if row.missed] == short
    assert result["speed, to the first"].measured == pytest.approx(1 / slower)
    assert result["processor time, to the first"].measured == pytest.approx(dearer)
