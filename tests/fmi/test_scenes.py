"""Each part of every shipped scene as an FMU: driven with recorded inputs, it has the recorded outputs bit for bit.

FMPy finds no fault in it, nor in its description for FMI 2.0.
"""

from pathlib import Path

import numpy as np
import pytest
from recorded_ports import DrivenService, RecordedPorts, scene_config

pytest.importorskip("fmpy")
from driven_fmu import assert_recorded_outputs
from fmpy import read_model_description, simulate_fmu
from fmpy.validation import validate_fmu

from lapwing.fmi.exported_part import PARTS, VEHICLE, ExportedPart
from lapwing.fmi.fmu import export_fmu
from lapwing.fmi.model_description import ModelNames, description
from lapwing.fmi.variables import variables_of

FIRMWARE = {"ardupilot_quad", "betaflight_quad", "px4_quad"}
SCENES = sorted(path.stem for path in Path("lapwing/scenes").glob("*.toml"))
MODELS = [
    "delivery_full",
    "hexacopter_tilted",
    "carried_load",
    "cooperative_load",
    "gyrostat_chaotic",
    "os4_motors",
    "slung_load",
    "unload",
]  # a scene of each model of the plant; tests/fmi/test_propeller_failures.py has that of five bodies
TICKS = 60


def assert_valid_for_fmi_2(part: ExportedPart, path: Path) -> None:
    """Check the description as `validate_fmu` does, without another export."""
    path.write_bytes(description(part, variables_of(part), ModelNames("part", "{token}", "Lapwing"), 2))
    read_model_description(str(path), validate=True, validate_variable_names=True, validate_model_structure=True)


@pytest.mark.long
@pytest.mark.parametrize("scene", SCENES)
def test_parts_have_recorded_outputs(scene: str, tmp_path: Path) -> None:
    setup = scene_config(scene, **{"run.duration": TICKS * scene_config(scene).interval})
    own = [part for part in PARTS if part in setup.services]
    recorded = {}
    if scene not in FIRMWARE:
        recorded = dict.fromkeys([*own, VEHICLE], RecordedPorts(setup))
    for part in own:
        recorded.setdefault(part, None)
    for part, ports in recorded.items():
        ports = ports or DrivenService(setup, part)
        exported = export_fmu(setup, part, tmp_path / "part.fmu", cpu="x86-64-v3")
        assert ports.ticks > TICKS // 2
        assert validate_fmu(str(tmp_path / "part.fmu")) == []
        assert_valid_for_fmi_2(exported, tmp_path / "modelDescription.xml")
        assert_recorded_outputs(tmp_path / "part.fmu", exported, ports)


@pytest.mark.long
@pytest.mark.parametrize("scene", MODELS)
def test_plant_for_fmi_2_has_outputs_of_fmi_3(scene: str, tmp_path: Path) -> None:
    """FMPy validates both and simulates them with the start values of their inputs."""
    setup, results = scene_config(scene), []
    for version in (2, 3):
        path = tmp_path / f"plant_{version}.fmu"
        names = [v.name for v in variables_of(export_fmu(setup, "plant", path, version)) if v.causality == "output"]
        assert validate_fmu(str(path)) == []
        stop = TICKS * setup.interval
        results.append(simulate_fmu(str(path), output=names, stop_time=stop, output_interval=setup.interval))
    a, b = results
    assert len(a) == len(b) == TICKS + 1
    for name in a.dtype.names:
        assert np.array_equal(a[name].astype(float), b[name].astype(float), equal_nan=True), name


@pytest.mark.parametrize("scene", sorted(FIRMWARE))
def test_vehicle_with_firmware_is_rejected(scene: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="runs Python code of the scene; only compiled blocks can be exported"):
        export_fmu(scene_config(scene), VEHICLE, tmp_path / "vehicle.fmu")
