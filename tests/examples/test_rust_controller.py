"""Build and lock-step flight of the autopilot in Rust, if cargo is installed. Nightly: it compiles 150 crates."""

import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest

from lapwing.api.flight import Flight
from lapwing.runs.resimulate import resimulate
from tests.combinations import NIGHTLY
from tests.commands import run_command
from tests.endpoints import loopback_endpoints

pytestmark = [pytest.mark.long, NIGHTLY]

CRATE = Path("examples/rust_controller")
SCENE = "examples/rust_mission.toml"
SHORT = ["--set", "run.duration=8.0"]


@pytest.fixture(scope="module")
def program():
    """Build the program and return its path."""
    if shutil.which("cargo") is None:
        pytest.skip("cargo is not installed")
    if subprocess.run(["cargo", "fetch", "--locked"], cwd=CRATE, check=False, capture_output=True).returncode:
        pytest.skip("the crates cannot be fetched")
    # not optimised: optimising the 150 crates takes two fifths of the build time, and the results are equal
    quick = {"CARGO_PROFILE_DEV_DEBUG": "0", "CARGO_INCREMENTAL": "0"}
    subprocess.run(["cargo", "build", "--locked", "--quiet"], cwd=CRATE, check=True, env={**os.environ, **quick})
    return Path(os.environ.get("CARGO_TARGET_DIR", CRATE / "target")) / "debug" / "rust_controller"


def fly(program, tmp_path, log, *more):
    layout, (endpoint,) = tmp_path / "layout.json", loopback_endpoints(["autopilot"]).values()
    run_command("protocol", SCENE, *SHORT, "--json", layout, code=0)
    own = subprocess.Popen([program, layout, endpoint, "test-rust"])
    try:
        where = ["--external", f"autopilot={endpoint}", "--insecure", "--key-prefix", "test-rust", "--log", str(log)]
        return run_command("run", SCENE, *SHORT, *where, "--json", log.with_suffix(".json"), *more), own.wait(120)
    finally:
        own.kill()


def test_rust_controller_flight_is_repeatable(program, tmp_path):
    digests = []
    for log in (tmp_path / "first.mcap", tmp_path / "second.mcap"):
        run, ended = fly(program, tmp_path, log)
        assert run.returncode == 0, run.stderr
        assert ended == 0
        digests.append(json.loads(log.with_suffix(".json").read_text())["digest"])
    assert digests[0] == digests[1]
    flight = Flight.read(tmp_path / "first.mcap")
    assert flight.rmse["z"] < 0.2
    assert flight.truth["pose.position"][-1, 2] > 4.0
    assert flight.topic("status")["armed"][-1]
    with pytest.raises(ValueError, match="cannot be resimulated: autopilot was an external service"):
        resimulate(tmp_path / "first.mcap")


def test_controller_of_another_scene_is_rejected(program, tmp_path):
    run, _ = fly(program, tmp_path, tmp_path / "log.mcap", "--set", "run.seed=3")
    assert run.returncode == 2
    assert "seed is 3 here but 1 in autopilot; start all services from the same scene" in run.stderr
