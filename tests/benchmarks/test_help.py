"""Command line of the benchmarks: help does not start a measurement, and wrong arguments are named."""

import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[2] / "benchmarks"
DEFINED = {path.stem for path in FOLDER.glob("[a-z]*.py")} | {path.parent.name for path in FOLDER.glob("*/__main__.py")}


def benchmark(name: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", f"benchmarks.{name}", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)


@pytest.mark.long
@pytest.mark.parametrize("name", sorted(DEFINED))
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
