"""System Structure and Parameterization packages: the parts of a scene as connected FMUs."""

import json
import tempfile
import zipfile
from pathlib import Path
from xml.etree import ElementTree as Xml

from lapwing.cosim.config.provenance import package_version
from lapwing.cosim.config.run_config import RunConfig
from lapwing.fmi import variables as kinds
from lapwing.fmi.fmu import ZIP_DATE, export_fmu
from lapwing.fmi.machine_code import PORTABLE
from lapwing.fmi.variables import variables_of
from lapwing.services.fmu.service_config import fmus_of
from lapwing.services.fmu.system_structure import COMMON, DESCRIPTION, PART, SCENE, STRUCTURE

SSP_VERSIONS = {3: "2.0", 2: "1.0"}  # by the version of FMI; SSP 1.0 does not know FMI 3.0


def export_system(setup: RunConfig, out: Path, version: int = 3, cpu: str = PORTABLE) -> list[str]:
    """Write a package with an FMU for each service of a scene, and return the names of the services.

    Args:
        setup: the scene, resolved.
        out: path of the package.
        version: of FMI, 3 (SSP 2.0) or 2 (SSP 1.0).
        cpu: generation of processors that run the FMUs.

    Raises:
        ValueError: a part cannot be exported, or there is no C compiler.
    """
    if fmus_of(setup.services) or setup.modules:
        raise ValueError(f"{setup.scene}: has code of other authors; export a scene without [services] and modules")
    connectors: dict[str, list[tuple[str, str]]] = {}
    with tempfile.TemporaryDirectory() as name:
        for part in setup.order:
            exported = export_fmu(setup, part, Path(name) / f"{part}.fmu", version, cpu)
            connectors[part] = [
                (v.name, v.causality) for v in variables_of(exported) if v.causality in (kinds.INPUT, kinds.OUTPUT)
            ]
        files = {f"resources/{part}.fmu": (Path(name) / f"{part}.fmu").read_bytes() for part in connectors}
    files[STRUCTURE] = _structure(setup, connectors, SSP_VERSIONS[version])
    files[SCENE] = json.dumps(setup.resolved, sort_keys=True).encode()
    with zipfile.ZipFile(out, "w") as archive:
        for path, content in files.items():
            archive.writestr(zipfile.ZipInfo(path, ZIP_DATE), content, zipfile.ZIP_DEFLATED)
    return list(connectors)


def _structure(setup: RunConfig, connectors: dict[str, list[tuple[str, str]]], version: str) -> bytes:
    """Return the system structure description: components in the order of execution, and their connections."""
    Xml.register_namespace("ssd", DESCRIPTION)
    Xml.register_namespace("ssc", COMMON)
    tool = {"generationTool": f"Lapwing {package_version()}"}
    root = Xml.Element(
        f"{{{DESCRIPTION}}}SystemStructureDescription", {"version": version, "name": setup.scene, **tool}
    )
    system = Xml.SubElement(root, f"{{{DESCRIPTION}}}System", {"name": setup.scene, "description": setup.title})
    elements = Xml.SubElement(system, f"{{{DESCRIPTION}}}Elements")
    common = {"type": "application/x-fmu-sharedlibrary", "implementation": "CoSimulation"}
    source: dict[str, str] = {}
    for part, listed in connectors.items():
        attributes = {"name": part, **common, "source": f"resources/{part}.fmu"}
        component = Xml.SubElement(elements, f"{{{DESCRIPTION}}}Component", attributes)
        own = Xml.SubElement(component, f"{{{DESCRIPTION}}}Connectors") if listed else component
        for name, kind in listed:
            Xml.SubElement(own, f"{{{DESCRIPTION}}}Connector", {"name": name, "kind": kind})
        notes = Xml.SubElement(component, f"{{{DESCRIPTION}}}Annotations")
        note = Xml.SubElement(notes, f"{{{COMMON}}}Annotation", {"type": PART})
        Xml.SubElement(note, "part", {"scene": SCENE, "name": part})
        source |= {name: part for name, kind in listed if kind == kinds.OUTPUT}
    connections = Xml.SubElement(system, f"{{{DESCRIPTION}}}Connections")
    for part, listed in connectors.items():
        for name, kind in listed:
            if kind == kinds.INPUT:
                ends = {"startElement": source[name], "startConnector": name, "endElement": part, "endConnector": name}
                Xml.SubElement(connections, f"{{{DESCRIPTION}}}Connection", ends)
    stop = {"startTime": "0", "stopTime": repr(setup.duration)}
    Xml.SubElement(root, f"{{{DESCRIPTION}}}DefaultExperiment", stop)
    Xml.indent(root)
    return Xml.tostring(root, "utf-8", xml_declaration=True) + b"\n"
