"""Every shipped scene as FMUs: their outputs are those of the run, bit for bit.

The FMU of a scene's vehicle contains all parts. Of the FMUs of single parts each scene has one, another one than the
scene before, because those of all parts of all scenes take minutes to compile. The FMUs of a scene alternate between
FMI 2.0 and 3.0. `test_fmu.py` and `test_propeller_failures.py` compare both versions of one part. FMPy finds no fault
in any FMU. `LAPWING_FMU_TICKS=100000 pytest tests/fmi/test_scenes.py -m long` compares whole flights and all parts.
"""

import os
from pathlib import Path

import pytest
from recorded_ports import DrivenService, RecordedPorts, scene_config

pytest.importorskip("fmpy")
from driven_fmu import assert_recorded_outputs
from fmpy.validation import validate_fmu

from lapwing.fmi.exported_part import PARTS, VEHICLE
from lapwing.fmi.fmu import export_fmu

FIRMWARE = {"ardupilot_quad", "betaflight_quad", "px4_quad"}
SCENES = sorted(path.stem for path in Path("lapwing/scenes").glob("*.toml"))
DEFAULT_TICKS = 60
TICKS = int(os.environ.get("LAPWING_FMU_TICKS", DEFAULT_TICKS))


@pytest.mark.long
@pytest.mark.parametrize("scene", SCENES)
def test_parts_have_recorded_outputs(scene: str, tmp_path: Path) -> None:
    whole = scene_config(scene)
    setup = scene_config(scene, **{"run.duration": min(whole.duration, TICKS * whole.interval)})
    own = [part for part in PARTS if part in setup.services]
    index, recorded = SCENES.index(scene), {}
    if scene not in FIRMWARE:
        own = own if TICKS > DEFAULT_TICKS else [own[index % len(own)]]
        recorded = dict.fromkeys([*own, VEHICLE], RecordedPorts(setup))
    for part in own:
        recorded.setdefault(part, None)
    for number, (part, ports) in enumerate(recorded.items(), index // len(PARTS)):
        ports = ports or DrivenService(setup, part)
        assert ports.ticks > min(setup.last_tick, TICKS // 2)
        path = tmp_path / f"{part}.fmu"
        exported = export_fmu(setup, part, path, 2 + number % 2, cpu="x86-64-v3")
        assert validate_fmu(str(path)) == []
        assert_recorded_outputs(path, exported, ports)


@pytest.mark.parametrize("scene", sorted(FIRMWARE))
def test_vehicle_with_firmware_is_rejected(scene: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"\.link: connected to a program outside Lapwing; only compiled blocks"):
        export_fmu(scene_config(scene), VEHICLE, tmp_path / "vehicle.fmu")
