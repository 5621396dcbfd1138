"""Clocks that jump in the process that is meant, and in no other."""

import os
import shutil
import subprocess
import sys
import time

import pytest

from lapwing.studies.stability import jumping_clock
from lapwing.studies.stability.cases.late_sensors import by_own_clock


@pytest.mark.parametrize(("name", "off"), [(jumping_clock.VICTIM, 3600.0), ("plant", 0.0)])
def test_the_clock_of_one_process_jumps(tmp_path, name, off):
    shutil.copy(jumping_clock.__file__, tmp_path / "sitecustomize.py")
    words = [sys.executable, "-c", "import time; print(time.time())", name]
    said = subprocess.run(words, env={**os.environ, "PYTHONPATH": str(tmp_path)}, capture_output=True, check=True)
    assert abs(float(said.stdout) - time.time()) == pytest.approx(off, abs=600.0)


def test_a_monotonic_clock_goes_only_forward():
    clock = jumping_clock.jumping(iter([0.0, 0.4, 0.5, 0.6, 1.6]).__next__, 1, jumping_clock.forward)
    assert [clock() for _ in range(5)] == pytest.approx([0.0, 0.4, 1.5, 1.6, 4.6])


def test_a_controller_with_a_clock_of_its_own_is_wrong_at_every_jump():
    assert by_own_clock(1000, 0.004) == 80  # 4 s, a jump every 0.05 s
