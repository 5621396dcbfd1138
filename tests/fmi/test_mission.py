"""The delivery mission, flown by FMUs of its parts that FMPy couples."""

from pathlib import Path

import pytest
from recorded_ports import scene_config
from truth_digest import digest_of_log, digest_of_rows

pytest.importorskip("fmpy")
from benchmarks.fmu_coupling import coupled
from tests.combinations import NIGHTLY
from tests.commands import run_command

SCENE = "delivery_mission"


@pytest.mark.long
@NIGHTLY
def test_plant_and_autopilot_in_fmpy_have_truth_digest_of_run(tmp_path: Path) -> None:
    """The whole flight with noisy sensors and estimator, from the files that `lapwing export-fmu` writes."""
    log = tmp_path / "mission.mcap"
    run_command("run", SCENE, "--mode", "single-process", "--log", log, code=0)
    expected, ticks = digest_of_log(log)
    config = scene_config(SCENE)
    paths = {part: tmp_path / f"{part}.fmu" for part in config.order}
    for part, path in paths.items():
        run_command("export-fmu", SCENE, "--part", part, "--out", path, code=0)
    rows = coupled(config, paths, jacobi=False, ticks=ticks)
    assert ticks > 10_000
    assert digest_of_rows(config, rows) == expected
