import zipfile
from pathlib import Path
from xml.etree import ElementTree as Xml

import pytest

from lapwing.cosim.log import LogReader

pytest.importorskip("fmpy")

from fmpy.ssp.ssd import read_ssd

from tests.combinations import rest_nightly
from tests.commands import assert_rejected, run_command

pytestmark = pytest.mark.long

STRUCTURE = "SystemStructure.ssd"
NOTE = '<ssc:Annotation type="org.lapwing.part">'
HOVER = ("--mode", "single-process", "--set", "run.duration=3.0", "--set", "success.require=[]")


def truth(log: Path) -> list[bytes]:
    with LogReader(log) as read:
        (topic,) = [topic for topic in read.topics() if topic.endswith("/ground_truth")]
        return [bytes(payload) for _, _, _, payload in read.messages([topic])]


def changed(package: Path, out: Path, *changes: tuple[str, str], without: str = "", more: dict | None = None) -> Path:
    """Write a package with replaced texts in its structure, without a file, and with further files."""
    with zipfile.ZipFile(package) as source, zipfile.ZipFile(out, "w") as archive:
        for name in source.namelist():
            content = source.read(name)
            if name == STRUCTURE:
                text = content.decode()
                for before, after in changes:
                    assert before in text, before
                    text = text.replace(before, after)
                content = text.encode()
            if name != without:
                archive.writestr(name, content)
        for name, text in (more or {}).items():
            archive.writestr(name, text)
    return out


def foreign(part: str) -> tuple[str, str]:
    """Return the change that makes a part an FMU of its own."""
    return f'<part scene="resources/scene.json" name="{part}" />', "<other />"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("ssp")
    for fmi in (2, 3):
        options = ("--fmi", str(fmi), "--cpu", "x86-64-v3", "--set", "run.duration=3.0", "--set", "success.require=[]")
        done = run_command("export-ssp", "hover", "--out", path / f"hover{fmi}.ssp", *options, code=0)
        assert f"SSP {fmi - 1}.0" in done.stdout
        assert "plant, trajectory, autopilot" in done.stdout
    done = run_command("run", "hover", "--log", path / "plain.mcap", *HOVER, code=0)
    return path


@pytest.mark.parametrize("fmi", [2, 3])
def test_exported_package_flies_with_bits_of_scene(folder: Path, fmi: int) -> None:
    log = folder / f"native{fmi}.mcap"
    run_command("run", folder / f"hover{fmi}.ssp", "--log", log, "--mode", "single-process", code=0)
    assert truth(log) == truth(folder / "plain.mcap")


def test_override_applies_to_package(folder: Path) -> None:
    log = folder / "short.mcap"
    options = ("--mode", "single-process", "--set", "run.duration=1.0")
    run_command("run", folder / "hover3.ssp", "--log", log, *options, code=0)
    assert len(truth(log)) == 251


@pytest.mark.parametrize("fmi", [2, 3])
def test_fmu_in_package_takes_place_of_part(folder: Path, fmi: int) -> None:
    package = changed(folder / f"hover{fmi}.ssp", folder / f"foreign{fmi}.ssp", foreign("autopilot"))
    log = folder / f"foreign{fmi}.mcap"
    done = run_command("run", package, "--log", log, "--mode", "single-process", code=2)
    assert "services.autopilot: an FMU contains machine code" in done.stderr
    ports = 'services.autopilot.outputs={"actuators.armed"="actuators.armed"}'
    done = run_command("run", package, "--log", log, "--allow-code", "--mode", "single-process", "--set", ports, code=0)
    assert truth(log) == truth(folder / "plain.mcap")
    done = run_command("resimulate", log, "--allow-code", code=0)


def nested(package: Path, out: Path) -> Path:
    """Write a package whose autopilot is in a system of its own, which has connectors of the autopilot's names."""
    kind = "{http://ssp-standard.org/SSP1/SystemStructureDescription}"
    with zipfile.ZipFile(package) as archive:
        root = Xml.fromstring(archive.read(STRUCTURE))
    system = root.find(f"{kind}System")
    elements, connections = system.find(f"{kind}Elements"), system.find(f"{kind}Connections")
    pilot = next(each for each in elements if each.get("name") == "autopilot")
    elements.remove(pilot)
    inner = Xml.SubElement(elements, f"{kind}System", {"name": "control"})
    Xml.SubElement(inner, f"{kind}Elements").append(pilot)
    pilot.set("name", "pilot")
    own = Xml.SubElement(inner, f"{kind}Connections")
    for each in connections:
        for side, other in (("start", "end"), ("end", "start")):
            if each.get(f"{side}Element") == "autopilot":
                each.set(f"{side}Element", "control")
                name = each.get(f"{side}Connector")
                inside = {f"{side}Element": "pilot", f"{side}Connector": name, f"{other}Connector": name}
                Xml.SubElement(own, f"{kind}Connection", inside)
    with zipfile.ZipFile(package) as source, zipfile.ZipFile(out, "w") as archive:
        for name in source.namelist():
            archive.writestr(name, Xml.tostring(root) if name == STRUCTURE else source.read(name))
    return out


def test_system_in_system_flies_like_flat_one(folder: Path, tmp_path: Path) -> None:
    flat = changed(folder / "hover3.ssp", tmp_path / "flat.ssp", foreign("autopilot"))
    package, log = nested(flat, tmp_path / "nested.ssp"), tmp_path / "nested.mcap"
    done = run_command("run", package, "--log", log, *HOVER, code=2)
    assert "services.control_pilot: an FMU contains machine code" in done.stderr
    ports = 'services.control_pilot.outputs={"actuators.armed"="actuators.armed"}'
    done = run_command("run", package, "--allow-code", "--log", log, *HOVER, "--set", ports, code=0)
    assert truth(log) == truth(folder / "plain.mcap")


def test_structure_satisfies_schema_of_fmpy(folder: Path) -> None:
    system = read_ssd(str(folder / "hover2.ssp")).system
    assert [element.name for element in system.elements] == ["plant", "trajectory", "autopilot"]
    ends = {(c.startElement, c.endElement) for c in system.connections}
    assert {("plant", "autopilot"), ("trajectory", "autopilot"), ("autopilot", "plant")} <= ends


@pytest.mark.parametrize("fmi", [2, 3])
def test_connectors_have_types(folder: Path, fmi: int) -> None:
    """The master libcosim requires them; their names are those of SSP 1.0, which SSP 2.0 has, too."""
    with zipfile.ZipFile(folder / f"hover{fmi}.ssp") as archive:
        root = Xml.fromstring(archive.read(STRUCTURE))
    connectors = {each.get("name"): each for each in root.iter() if each.tag.endswith("}Connector")}
    found = [connectors[name][0].tag for name in ("truth.position_world[0]", "status.phase", "actuators.armed")]
    assert [tag.rpartition("}")[2] for tag in found] == ["Real", "Integer", "Boolean"]
    assert all(len(each) == 1 for each in connectors.values())


def test_fmpy_flies_package(folder: Path) -> None:
    from fmpy.ssp.simulation import simulate_ssp

    result = simulate_ssp(str(folder / "hover2.ssp"), stop_time=3.0, step_size=0.004)
    height = result["plant.truth.position_world[2]"]
    assert height[-1] == pytest.approx(1.35, abs=0.01)  # a Jacobi coupling: not the bits of the scene


@pytest.mark.parametrize(
    ("changes", "message"),
    rest_nightly(
        ([('version="2.0"', 'version="3.0"')], "SSP version 3.0; expected version 1.0 or 2.0"),
        ([foreign("plant"), foreign("trajectory"), foreign("autopilot")], "has no Lapwing part"),
        ([('source="resources/plant.fmu"', 'source="resources/wing.fmu"'), foreign("plant")], "no file resources/wing"),
        ([(' type="application/x-fmu-sharedlibrary"', ' type="application/x-dll"'), foreign("plant")], "has the type"),
        ([('name="plant" type', 'name="a plant" type'), foreign("plant")], "a connection of plant"),
        ([('startElement="plant"', 'startElement="wing"')], "a connection of wing; expected connections between"),
        ([("<ssd:Elements>", '<ssd:Elements><ssd:SignalDictionaryReference name="a" />')], "a is a SignalDictionaryRe"),
        ([("<ssd:Elements>", '<ssd:Elements><ssd:System name="plant" />')], "two elements have the name plant"),
        (
            [("<ssd:Elements>", '<ssd:Elements><ssd:System name="a"><ssd:ParameterBindings /></ssd:System>')],
            "system a has parameter bindings; expected parameters of its components",
        ),
        (
            [
                ("<ssd:Elements>", '<ssd:Elements><ssd:System name="inner" />'),
                ('startElement="trajectory"', 'startElement="inner"'),
                foreign("autopilot"),
            ],
            "of system inner has no source; expected a connection from a component",
        ),
        ([('name="plant" />', 'name="plant" ')], "SystemStructure.ssd is not XML"),
        ([("<ssd:System name", "<!DOCTYPE a><ssd:System name")], "declares a document type"),
        keep=4,
    ),
)
def test_invalid_package_is_one_line(folder: Path, tmp_path: Path, changes: list, message: str) -> None:
    package = changed(folder / "hover3.ssp", tmp_path / "bad.ssp", *changes)
    assert_rejected(run_command("run", package, "--allow-code", "--log", tmp_path / "a.mcap", *HOVER), message)
    assert not (tmp_path / "a.mcap").exists()


def test_damaged_package_is_one_line(folder: Path, tmp_path: Path) -> None:
    path = tmp_path / "bad.ssp"
    for content, message in ((b"no archive", "not a package"), (b"", "not a package")):
        path.write_bytes(content)
        done = run_command("run", path, "--log", tmp_path / "a.mcap")
        assert_rejected(done, message)
    package = changed(folder / "hover3.ssp", path, without="resources/scene.json")
    done = run_command("run", package, "--log", tmp_path / "a.mcap", code=2)
    assert "has no file resources/scene.json" in done.stderr
    assert "No such file" not in done.stderr


def test_scene_file_and_parameters_of_package_are_read(folder: Path, tmp_path: Path) -> None:
    bindings = """<ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues><ssv:ParameterSet version="2.0"
      name="a" xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues"><ssv:Parameters>
      <ssv:Parameter name="parameters.autopilot.none"><ssv:Real value="1.5" /></ssv:Parameter></ssv:Parameters>
      </ssv:ParameterSet></ssd:ParameterValues></ssd:ParameterBinding></ssd:ParameterBindings>"""
    text = Path("lapwing/scenes/hover.toml").read_text()
    package = changed(
        folder / "hover3.ssp", tmp_path / "a.ssp", foreign("autopilot"), ("resources/scene.json", "resources/a.toml"),
        ('source="resources/autopilot.fmu">', f'source="resources/autopilot.fmu">{bindings}'),
        without="resources/scene.json", more={"resources/a.toml": text},
    )  # fmt: skip
    done = run_command("check", package, code=2)
    assert "services.autopilot.start.parameters.autopilot.none: unknown variable" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--fmi", "1"], "--fmi 1: unknown version; use 2 or 3"),
        (["--out", "x.zip"], "use a name that ends in .ssp"),
        (["--set", "vehicle.nam=1"], "unknown key"),
    ],
)
def test_invalid_export_is_rejected_in_one_line(arguments: list[str], message: str, tmp_path: Path) -> None:
    out = tmp_path / "x.ssp"
    assert_rejected(run_command("export-ssp", "hover", "--out", out, *arguments), message)
    assert not out.exists()
