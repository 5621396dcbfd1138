"""Help of the benchmarks: it describes the measurement and does not start it."""

import subprocess
import sys

import pytest


@pytest.mark.parametrize("name", ["fmi", "fmu_coupling", "lockstep"])
def test_help_describes_benchmark_without_measurement(name):
    command = [sys.executable, "-m", f"benchmarks.{name}", "--help"]
    result = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert (result.returncode, result.stderr) == (0, "")
    assert f"python -m benchmarks.{name} [" in result.stdout
    assert len(result.stdout.splitlines()) < 20
