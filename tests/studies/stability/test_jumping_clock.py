"""Jumping clocks: they affect the selected process alone."""

import os
import shutil
import subprocess
import sys
import time

import pytest

from lapwing.studies.stability import jumping_clock
from lapwing.studies.stability.cases.late_sensors import wall_clock_errors


@pytest.mark.parametrize(("name", "off"), [(jumping_clock.VICTIM, 3600.0), ("plant", 0.0)])
def test_clock_of_one_process_jumps(tmp_path, name, off):
    shutil.copy(jumping_clock.__file__, tmp_path / "sitecustomize.py")
    arguments = [sys.executable, "-c", "import time; print(time.time())", name]
    output = subprocess.run(arguments, env={**os.environ, "PYTHONPATH": str(tmp_path)}, capture_output=True, check=True)
    assert abs(float(output.stdout) - time.time()) == pytest.approx(off, abs=600.0)


def test_monotonic_clock_never_decreases():
    clock = jumping_clock.add_jumps(iter([0.0, 0.4, 0.5, 0.6, 1.6]).__next__, 1, jumping_clock.forward)
    assert [clock() for _ in range(5)] == pytest.approx([0.0, 0.4, 1.5, 1.6, 4.6])


def test_wall_clock_baseline_errs_at_every_jump():
    assert wall_clock_errors(1000, 0.004) == 80  # 4 s, a jump every 0.05 s
