"""The delivery mission, flown by FMUs of its parts that FMPy couples."""

import subprocess
import sys
from pathlib import Path

import pytest
from recorded_ports import scene_config
from truth_digest import digest_of_log, digest_of_rows

pytest.importorskip("fmpy")
from benchmarks.fmu_coupling import coupled
from tests.combinations import NIGHTLY

SCENE = "delivery_mission"


def run_command(*arguments: str) -> str:
    done = subprocess.run([sys.executable, "-m", "lapwing", *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.long
@NIGHTLY
def test_plant_and_autopilot_in_fmpy_have_truth_digest_of_run(tmp_path: Path) -> None:
    """The whole flight with noisy sensors and estimator, from the files that `lapwing export-fmu` writes."""
    log = tmp_path / "mission.mcap"
    run_command("run", SCENE, "--mode", "single-process", "--log", str(log))
    expected, ticks = digest_of_log(log)
    config = scene_config(SCENE)
    paths = {part: tmp_path / f"{part}.fmu" for part in config.order}
    for part, path in paths.items():
        run_command("export-fmu", SCENE, "--part", part, "--out", str(path))
    rows = coupled(config, paths, jacobi=False, ticks=ticks)
    assert ticks > 10_000
    assert digest_of_rows(config, rows) == expected
