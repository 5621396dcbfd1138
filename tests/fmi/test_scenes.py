"""The plant of every shipped scene as an FMU: driven with recorded inputs, it has the recorded outputs bit for bit."""

from pathlib import Path

import pytest
from recorded_ports import DrivenPlant, RecordedPorts, scene_config

pytest.importorskip("fmpy")
from driven_fmu import assert_recorded_outputs

from lapwing.fmi.fmu import export_fmu

pytestmark = pytest.mark.long
FIRMWARE = {"ardupilot_quad", "betaflight_quad", "px4_quad"}
SCENES = sorted(path.stem for path in Path("lapwing/scenes").glob("*.toml"))
TICKS = 60


@pytest.mark.parametrize("scene", SCENES)
def test_plant_has_recorded_outputs(scene: str, tmp_path: Path) -> None:
    interval = scene_config(scene).interval
    setup = scene_config(scene, **{"run.duration": TICKS * interval})
    recorded = (DrivenPlant if scene in FIRMWARE else RecordedPorts)(setup)
    exported = export_fmu(setup, "plant", tmp_path / "plant.fmu", cpu="x86-64-v3")
    assert recorded.ticks > TICKS // 2
    assert_recorded_outputs(tmp_path / "plant.fmu", exported, recorded)
