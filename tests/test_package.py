"""What is not Python and must be in a wheel is in one."""

import tomllib
from pathlib import Path

import pytest

from lapwing.kernels.compiler.cache_files import SHIPPED

ROOT = Path(__file__).parent.parent
SETUPTOOLS = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]


@pytest.mark.parametrize("folder", ["scenes", "services", "messages", "studies"])
def test_data_files_are_packaged(folder):
    assert f"{folder}*" in SETUPTOOLS["packages"]["find"]["include"]
    packaged = {path for glob in SETUPTOOLS["package-data"][folder] for path in (ROOT / folder).glob(glob)}
    there = {path for path in (ROOT / folder).rglob("*") if path.is_file() and path.suffix not in (".py", ".pyc")}
    assert there <= packaged


def test_kernels_that_a_wheel_is_to_carry_are_packaged():
    (glob,) = SETUPTOOLS["package-data"]["dynamics"]
    assert (ROOT / "dynamics" / glob).is_relative_to(SHIPPED)
