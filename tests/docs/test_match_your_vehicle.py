"""Guide to real flights: its commands run unchanged, in order, in an empty folder, from a simulated ULog."""

import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from flight_recordings import real_flights

PAGE = (Path(__file__).parents[2] / "docs/guides/match_your_vehicle.md").read_text()
BLOCKS = re.findall(r"```sh\n(.*?)```", PAGE, re.DOTALL)
TRUE = {"effects.rotor_quadratic.thrust_constant": 1.9e-8, "airframe.motor.time_constant": 0.04}


def typed(folder: Path, block: str) -> str:
    """Return the output of the commands of a block, with the package under test."""
    path = {"PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}", "COLUMNS": "80"}
    done = subprocess.run(["bash", "-ec", block], cwd=folder, capture_output=True, text=True, env=os.environ | path)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.long
def test_simulated_log_leads_to_a_verdict(tmp_path):
    output = typed(tmp_path, "".join(BLOCKS[:2]))
    verdicts = re.findall(r"^crazyflie_21 on 1 flight, \d+ windows: (.*)", output, re.MULTILINE)
    assert len(verdicts) == 2
    assert verdicts[1].startswith("good enough for position loops, attitude loops and rate-loop tuning")
    means = tomllib.loads((tmp_path / "vehicles/identified.toml").read_text())["posterior"]
    estimates = dict(zip(means["keys"], means["mean"], strict=True))
    assert estimates == pytest.approx(TRUE, rel=0.02)
    assert "actuator_motors" in output  # table of the import


@pytest.mark.nightly
def test_nanobench_leads_to_a_verdict(tmp_path):
    (tmp_path / "nanobench").mkdir()
    (tmp_path / "vehicles").mkdir()
    for name in ("B2_circle_slow_rep1", "B3_figure8_slow_rep1", "B7_oval_slow_rep2"):
        shutil.copy(real_flights("nanobench") / f"{name}.csv.gz", tmp_path / "nanobench")
    output = typed(tmp_path, BLOCKS[2])
    assert "crazyflie_21 on 3 flights" in output
    assert (tmp_path / "vehicles/nanobench.toml").exists()
