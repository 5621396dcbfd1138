"""Shipped scenes as FMUs: their outputs are those of the run, bit for bit. All but `EVERY_DAY` are nightly.

Each scene exports one part, by turns a service or the whole vehicle, because all parts of all scenes take minutes to
compile. FMI 2.0 and 3.0 alternate. `test_fmu.py` and `test_propeller_failures.py` compare both versions of one part.
FMPy finds no fault in any FMU. `LAPWING_FMU_TICKS=100000 pytest tests/fmi/test_scenes.py -m "nightly or long"` compares
all parts over whole flights.
"""

import os
from pathlib import Path

import pytest
from recorded_ports import DrivenService, RecordedPorts, scene_config

pytest.importorskip("fmpy")
from driven_fmu import assert_recorded_outputs
from fmpy.validation import validate_fmu

from lapwing.fmi.export.exported_part import PARTS, VEHICLE
from lapwing.fmi.export.fmu import export_fmu
from tests.combinations import NIGHTLY

FIRMWARE = {"ardupilot_quad", "betaflight_quad", "px4_quad"}
SCENES = sorted(path.stem for path in Path("lapwing/scenes").glob("*.toml"))
EVERY_DAY = {"fleet", "gyrostat_feedback"}
DEFAULT_TICKS = 60
TICKS = int(os.environ.get("LAPWING_FMU_TICKS", DEFAULT_TICKS))


@pytest.mark.long
@pytest.mark.parametrize("scene", [s if s in EVERY_DAY else pytest.param(s, marks=NIGHTLY) for s in SCENES])
def test_parts_have_recorded_outputs(scene: str, tmp_path: Path) -> None:
    whole = scene_config(scene)
    config = scene_config(scene, **{"run.duration": min(whole.duration, TICKS * whole.interval)})
    parts = [part for part in PARTS if part in config.services or (part == VEHICLE and scene not in FIRMWARE)]
    index = SCENES.index(scene)
    if TICKS == DEFAULT_TICKS:
        parts = [parts[index % len(parts)]]
    whole_run = None if scene in FIRMWARE else RecordedPorts(config)
    for number, part in enumerate(parts, index // len(PARTS)):
        ports = whole_run or DrivenService(config, part)
        assert ports.ticks > min(config.last_tick, TICKS // 2)
        path = tmp_path / f"{part}.fmu"
        exported = export_fmu(config, part, path, 2 + number % 2, cpu="x86-64-v3")
        assert validate_fmu(str(path)) == []
        assert_recorded_outputs(path, exported, ports)


@pytest.mark.parametrize("scene", sorted(FIRMWARE))
def test_vehicle_with_firmware_is_rejected(scene: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"\.link: connected to a program outside Lapwing; only compiled blocks"):
        export_fmu(scene_config(scene), VEHICLE, tmp_path / "vehicle.fmu")
