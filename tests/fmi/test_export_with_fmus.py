"""Scenes with FMUs of their own, exported as packages (SSP), FMUs and libraries."""

import re
import zipfile
from pathlib import Path
from xml.etree import ElementTree as Xml

import pytest
from effect_fmu import write_effect_fmu
from event_fmu import write_event_fmu
from small_fmu import write_small_fmu

fmpy = pytest.importorskip("fmpy")
from lxml import etree  # noqa: E402

from tests.commands import assert_rejected, run_command  # noqa: E402

pytestmark = pytest.mark.long

HOVER = Path("lapwing/scenes/hover.toml").resolve()
SCENE = """
[effects.wind_constant]
velocity = [0.0, 0.0, 0.0]
[effects.body_drag]
[effects.battery]
[effects.dc_motor]
[services.pack]
fmu = "parts.fmu"
start = { open_circuit = 48.0, resistance = 0.01, wind = 2.0, torque_constant = 0.2, winding = 0.1 }
[services.pack.inputs]
current_0 = "truth.motor_current.0"
voltage_0 = "actuators.motor_voltage.0"
speed_0 = "truth.rotor_speed.0"
[services.pack.outputs]
"effect.battery.voltage" = "supply"
"effect.wind_constant.velocity.1" = "wind_y"
"effect.dc_motor.torque.0" = "torque_0"
[services.sense]
fmu = "small.fmu"
start = { gain = 3.28 }
[services.sense.inputs]
u = "truth.position_world.2"
[services.motor]
fmu = "small.fmu"
delay = 1
start = { gain = 0.5, label = "0.5" }
[services.motor.inputs]
u = "sense.y"
[services.motor.outputs]
"trajectory.position_world.1" = "y"
"""
OPTIONS = ("--set", "run.duration=1.0", "--set", "success.require=[]")
NAMES = {
    "d": "http://ssp-standard.org/SSP1/SystemStructureDescription",
    "c": "http://ssp-standard.org/SSP1/SystemStructureCommon",
}


def digest(scene: Path, *options: str) -> str:
    log = scene.with_suffix(".mcap")
    done = run_command("run", scene, "--allow-code", "--mode", "single-process", "--log", log, *options, code=0)
    result = re.search(r"digest\s+(\w+)", done.stdout)
    assert result
    return result[1]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("ssp")
    write_effect_fmu(path / "parts.fmu")
    write_small_fmu(path / "small.fmu", unit_u="ft", unit_y="ft")
    (path / "scene.toml").write_text(HOVER.read_text() + SCENE)
    done = run_command("export-ssp", path / "scene.toml", "--allow-code", "--out", path / "a.ssp", *OPTIONS, code=0)
    assert "plant, trajectory, autopilot, pack, sense, motor" in done.stdout
    return path


def test_package_has_digest_of_scene(folder: Path) -> None:
    assert digest(folder / "a.ssp") == digest(folder / "scene.toml", *OPTIONS)


def test_exchanged_fmu_of_package_has_digest_of_scene(folder: Path) -> None:
    """Without its annotation the FMU of the battery takes connections and start values from the package."""
    package = folder / "exchanged.ssp"
    with zipfile.ZipFile(folder / "a.ssp") as source, zipfile.ZipFile(package, "w") as archive:
        for name in source.namelist():
            text = source.read(name)
            archive.writestr(name, text.replace(b'<part scene="resources/scene.json" name="pack" />', b"<other />"))
    assert digest(package) == digest(folder / "scene.toml", *OPTIONS)


def test_package_without_fmu_flies_without_it(folder: Path) -> None:
    """A tool may remove a component with its connections: the effect computes the battery again."""
    package = folder / "removed.ssp"
    with zipfile.ZipFile(folder / "a.ssp") as source, zipfile.ZipFile(package, "w") as archive:
        root = Xml.fromstring(source.read("SystemStructure.ssd"))
        for parent in (root.find("d:System/d:Elements", NAMES), root.find("d:System/d:Connections", NAMES)):
            for each in list(parent):
                if "pack" in (each.get("name"), each.get("startElement"), each.get("endElement")):
                    parent.remove(each)
        for name in source.namelist():
            if name != "resources/pack.fmu":
                archive.writestr(name, Xml.tostring(root) if name.endswith(".ssd") else source.read(name))
    done = run_command("check", package, code=0)
    assert "pack_fmu" not in done.stdout
    assert "motor_fmu" in done.stdout


def test_structure_satisfies_schema_of_fmpy(folder: Path) -> None:
    """FMPy has the schema of SSP 1.0, which differs by the version here."""
    schema = etree.XMLSchema(file=str(Path(fmpy.__file__).parent / "ssp/schema/SystemStructureDescription.xsd"))
    with zipfile.ZipFile(folder / "a.ssp") as archive:
        text = archive.read("SystemStructure.ssd").replace(b'version="2.0"', b'version="1.0"')
    assert b"<ssv:Real value=" in text
    schema.assertValid(etree.fromstring(text))


def test_connections_have_sources_and_factors(folder: Path) -> None:
    with zipfile.ZipFile(folder / "a.ssp") as archive:
        root = Xml.fromstring(archive.read("SystemStructure.ssd"))
    result = {}
    for each in root.iterfind("d:System/d:Connections/d:Connection", NAMES):
        ends = [each.get(f"{side}{what}") for side in ("start", "end") for what in ("Element", "Connector")]
        change = each.find("c:LinearTransformation", NAMES)
        result[".".join(ends[2:])] = ".".join(ends[:2]), 1.0 if change is None else float(change.get("factor"))
    assert result["plant.effect.battery.voltage"] == ("pack.supply", 1.0)
    assert result["pack.current_0"] == ("plant.truth.motor_current[0]", 1.0)
    assert result["sense.u"] == ("plant.truth.position_world[2]", pytest.approx(1 / 0.3048))
    assert result["motor.u"] == ("sense.y", 1.0)
    assert result["autopilot.trajectory.position_world[1]"] == ("motor.y", pytest.approx(0.3048))
    assert result["autopilot.trajectory.position_world[0]"] == ("trajectory.trajectory.position_world[0]", 1.0)


@pytest.mark.parametrize("command", ["export-ssp", "export-fmu", "export-library"])
def test_export_needs_permission_for_fmus(folder: Path, command: str) -> None:
    out = folder / {"export-ssp": "x.ssp", "export-fmu": "x.fmu", "export-library": "x"}[command]
    assert_rejected(
        run_command(command, folder / "scene.toml", "--out", out, *OPTIONS),
        "an FMU contains machine code; if you trust its author, use --allow-code to run it",
    )
    assert not out.is_file()


@pytest.mark.parametrize("command", ["export-fmu", "export-library"])
def test_plant_with_permission_is_exported(folder: Path, command: str) -> None:
    """The plant has the named input of its battery."""
    out = folder / {"export-fmu": "plant.fmu", "export-library": "plant"}[command]
    done = run_command(command, folder / "scene.toml", "--allow-code", "--out", out, *OPTIONS, code=0)
    if command == "export-fmu":
        assert "inputs actuators, status, effect.battery" in done.stdout


def test_fmus_that_package_cannot_have_are_named(tmp_path: Path) -> None:
    write_event_fmu(tmp_path / "ball.fmu")
    ball = '\n[services.ball]\nfmu = "ball.fmu"\n[services.ball.inputs]\n"u[0]" = "truth.velocity_world.2"\n'
    ball += '[services.ball.outputs]\n"trajectory.position_world.2" = "h"\n'
    scene = tmp_path / "ball.toml"
    scene.write_text(HOVER.read_text() + ball)
    for fmi, message in (
        ("2", "is an FMU of FMI 3.0, which SSP 1.0 does not support; use --fmi 3"),
        ("3", "u[0] is an element"),
    ):
        assert_rejected(
            run_command("export-ssp", scene, "--allow-code", "--fmi", fmi, "--out", tmp_path / "a.ssp"),
            "services.ball: ",
            message,
        )
        assert not (tmp_path / "a.ssp").exists()
