"""A built wheel works outside of the repository: it finds what ships by name, and writes to ./recordings."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.long

ROOT = Path(__file__).parents[2]


def test_a_wheel_flies_a_shipped_scene_from_any_folder(tmp_path):
    source = tmp_path / "source"
    for name in ("lapwing", "messages", "services"):
        shutil.copytree(ROOT / name, source / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md"):
        shutil.copy(ROOT / name, source)
    pip = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]
    build = [*pip, "wheel", "--no-deps", "--no-build-isolation", "--wheel-dir", str(tmp_path), str(source)]
    made = subprocess.run(build, capture_output=True, text=True, timeout=300, check=False)
    assert made.returncode == 0, made.stderr
    (wheel,) = tmp_path.glob("lapwing-*.whl")
    site, work = tmp_path / "site", tmp_path / "work"
    work.mkdir()
    subprocess.run([*pip, "install", "--no-deps", "--target", str(site), str(wheel)], check=True, timeout=300)
    environment = {**os.environ, "PYTHONPATH": str(site)}

    def python(*arguments):
        command = [sys.executable, "-P", *arguments]
        return subprocess.run(
            command, cwd=work, env=environment, capture_output=True, text=True, timeout=300, check=False
        )

    assert (
        str(site)
        in python(
            "-c", "import lapwing.services.scene_resolver; print(lapwing.services.scene_resolver.__file__)"
        ).stdout
    )
    flown = python(
        "-m", "lapwing", "run", "gyrostat_blocked", "--set", "run.duration=50.0", "--key-prefix", "test-wheel"
    )
    assert flown.returncode == 0, flown.stderr
    assert len(list((work / "recordings").glob("gyrostat_blocked_*.mcap"))) == 1
    assert len(list((work / "recordings").glob("gyrostat_blocked_*.html"))) == 1
    assert python("-m", "lapwing", "check", "delivery_mission").returncode == 0
