"""Files in the working directory are not imported, regardless of their names."""

import subprocess
import sys
from pathlib import Path

import pytest

LAPWING = Path(sys.executable).with_name("lapwing")


@pytest.mark.long
def test_working_directory_does_not_shadow_packages(tmp_path):
    for name in ("messages", "services", "lapwing", "numpy"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text("raise SystemExit('imported from the working directory')\n")
    command = [LAPWING, "run", "gyrostat_blocked", "--set", "run.duration=50.0", "--key-prefix", "test-directory"]
    result = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=200, check=False)
    assert result.returncode == 0, result.stderr
    assert "digest" in result.stdout
