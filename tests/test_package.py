"""Package data is declared; `make` prints the steps of its set-up."""

import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest

from lapwing.kernels.compiler.cache_files import SHIPPED

ROOT = Path(__file__).parent.parent
SETUPTOOLS = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]
FOLDERS = [ROOT / name for name in ("lapwing", "lapwing/services", "lapwing/messages")]  # two are links


def test_package_data_covers_data_files():
    globs = SETUPTOOLS["package-data"]["lapwing"]
    endings = {glob.removeprefix("**/*") for glob in globs if glob.startswith("**/*.")}
    files = [path for folder in FOLDERS for path in folder.rglob("*") if path.is_file()]
    data = [path for path in files if path.suffix not in (".py", ".pyc") and path.name != "README.md"]
    assert {path.suffix for path in data if not path.is_relative_to(SHIPPED)} <= endings


def test_type_checkers_read_annotations():
    assert (ROOT / "lapwing/py.typed").is_file()


def test_package_data_covers_shipped_kernels():
    assert f"{SHIPPED.relative_to(ROOT / 'lapwing')}/**/*" in SETUPTOOLS["package-data"]["lapwing"]


@pytest.mark.skipif(shutil.which("make") is None, reason="needs make")
def test_make_prints_set_up_steps_without_durations(tmp_path):
    command = ["make", "--dry-run", "mission", f"VENV={tmp_path}/venv"]
    lines = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    first, *_ = (line for line in lines.splitlines() if "-m pip install" in line)
    assert "quiet" not in first  # the last installation is: kernels are compiled meanwhile, in one line
    assert "minute" not in lines
