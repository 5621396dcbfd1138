"""The wheel installs one package, which flies, runs campaigns and connects MAVLink from any folder."""

import os
import shutil
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import common

pytestmark = pytest.mark.long

ROOT = Path(__file__).parents[2]
QUICK = ("--set", "run.duration=0.3", "--set", "success.require=[]")


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Return a folder with an installed wheel of this checkout, without its dependencies."""
    folder = tmp_path_factory.mktemp("wheel")
    source = folder / "source"
    for name in ("lapwing", "messages", "services"):
        shutil.copytree(ROOT / name, source / name, symlinks=True, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    pip = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]
    build = [*pip, "wheel", "--no-deps", "--no-build-isolation", "--wheel-dir", folder, source]
    built = subprocess.run(build, capture_output=True, text=True, timeout=300, check=False)
    assert built.returncode == 0, built.stderr
    (wheel,) = folder.glob("lapwing-*.whl")
    subprocess.run([*pip, "install", "--no-deps", "--target", folder / "site", wheel], check=True, timeout=300)
    return folder / "site"


@pytest.fixture
def run(site, tmp_path):
    """Run Python with the installed package in an empty folder."""
    environment = {**os.environ, "PYTHONPATH": str(site)}

    def python(*arguments):
        command = [sys.executable, "-P", *map(str, arguments)]
        return subprocess.run(
            command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=600, check=False
        )

    return python


def test_wheel_installs_one_package(site):
    names = {path.name for path in site.iterdir() if not path.name.endswith(".dist-info")}
    assert names - {"bin", "__pycache__"} == {"lapwing"}


def test_wheel_flies_from_any_folder(site, run, tmp_path):
    assert str(site) in run("-c", "import lapwing.services; print(lapwing.services.__file__)").stdout
    flight = run("-m", "lapwing", "run", "hover", *QUICK, "--key-prefix", "test-wheel")
    assert flight.returncode == 0, flight.stderr
    assert len(list((tmp_path / "recordings").glob("hover_*.mcap"))) == 1
    assert run("-m", "lapwing", "check", "delivery_mission").returncode == 0


def test_wheel_runs_campaign(run, tmp_path):
    campaign = run("-m", "lapwing", "campaign", "hover", "--runs", 2, "--out", tmp_path / "campaign", *QUICK[:2])
    assert campaign.returncode == 0, campaign.stderr


def test_wheel_connects_mavlink(run):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station:
        station.bind(("127.0.0.1", 0))
        url = f"udpout:127.0.0.1:{station.getsockname()[1]}"
        flight = run("-m", "lapwing", "run", "hover", *QUICK, "--mavlink", url, "--key-prefix", "test-wheel-link")
        assert flight.returncode == 0, flight.stderr
        station.settimeout(5.0)
        parsed = common.MAVLink(None).parse_buffer(station.recv(2048))
        assert parsed
