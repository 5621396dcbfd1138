"""System Structure and Parameterization packages: the parts of a scene and its imported FMUs as connected FMUs."""

import json
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree as Xml

from lapwing.cosim.config.provenance import package_version
from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.multi_vehicle import members
from lapwing.fmi.export import variables as kinds
from lapwing.fmi.export.fmu import export_fmu, write_archive
from lapwing.fmi.export.machine_code import PORTABLE
from lapwing.fmi.export.model_description import TYPES
from lapwing.fmi.export.variables import column_names, variables_of
from lapwing.fmi.importer import system_structure as ssp
from lapwing.fmi.importer.description import content_of
from lapwing.fmi.importer.service_config import FmuConfig, StartValue, fmus_of, own_port
from lapwing.services.common.foreign_code import FMU_SUFFIX

SSP_VERSIONS = {3: "2.0", 2: "1.0"}  # SSP version by version of FMI; SSP 1.0 has no FMI 3.0
_BOTH_VERSIONS = {"Float64": "Real", "Int32": "Integer"}  # names of types that readers of SSP 1.0 know, too
_UNTYPED = "Enumeration"  # type without an element: the package would need its definition, which the FMU has


class _Source(NamedTuple):
    """Start of a connection."""

    component: str
    connector: str
    factor: float  # conversion from its unit to that of the other end


class _Connector(NamedTuple):
    """Input or output of a component."""

    kind: str  # INPUT or OUTPUT
    type: str  # type in the description of the FMU: Real, Float64, ...


class _Component(NamedTuple):
    """An FMU of the package."""

    name: str
    connectors: dict[str, _Connector]  # by name
    sources: dict[str, _Source]  # by input
    start: Sequence[StartValue]


def export_system(config: RunConfig, out: Path, version: int = 3, cpu: str = PORTABLE) -> list[str]:
    """Write a package with an FMU for each service of a scene, and return the names of the services.

    Args:
        config: run configuration of the scene.
        out: path of the package.
        version: version of FMI, 3 (SSP 2.0) or 2 (SSP 1.0).
        cpu: generation of processors that run the FMUs.

    Raises:
        ValueError: a part cannot be exported, an FMU of the scene does not fit, or there is no C compiler.
    """
    fmus = fmus_of(config.services)
    _check(config, fmus, version)
    parts: dict[str, dict[str, _Connector]] = {}
    files: dict[str, bytes] = {}
    with tempfile.TemporaryDirectory() as folder:
        for name in (each for each in config.order if not each.endswith(FMU_SUFFIX)):
            path = Path(folder) / f"{name}.fmu"
            variables = variables_of(export_fmu(config, name, path, version, cpu))
            parts[name] = {
                v.name: _Connector(v.causality, TYPES[version][v.type])
                for v in variables
                if v.causality in (kinds.INPUT, kinds.OUTPUT)
            }
            files[ssp.FMU_PATH.format(name)] = path.read_bytes()
    for fmu in fmus:
        content = content_of(f"services.{fmu.name}.fmu", Path(fmu.path), fmu.content)
        files[ssp.FMU_PATH.format(fmu.name)] = content
    components = _components(config, parts, fmus)
    files[ssp.STRUCTURE] = _structure(config, components, SSP_VERSIONS[version])
    files[ssp.SCENE] = json.dumps(_scene(config, fmus), sort_keys=True).encode()
    write_archive(out, files)
    return [component.name for component in components]


def _check(config: RunConfig, fmus: Iterable[FmuConfig], version: int) -> None:
    """Raise ValueError if a scene cannot be exported as a package."""
    if config.modules:
        raise ValueError(f"{config.scene}: a package cannot contain its Python modules; export a scene without them")
    if not config.vehicle and any(fmus_of(member.services) for member in members(config)):
        raise ValueError(f"{config.scene}: has [services] of several vehicles; export a scene of one vehicle")
    for fmu in fmus:
        if fmu.version > version:
            raise ValueError(f"services.{fmu.name}: is an FMU of FMI 3.0, which SSP 1.0 does not support; use --fmi 3")
        for element in (*(c.element for c in (*fmu.inputs, *fmu.outputs)), *(each.element for each in fmu.start)):
            if element.size > 1:
                message = f"services.{fmu.name}: {element.variable} is an element of an array"
                raise ValueError(f"{message}, which SSP cannot connect; use scalar variables")


def _components(
    config: RunConfig, parts: dict[str, dict[str, _Connector]], fmus: Sequence[FmuConfig]
) -> list[_Component]:
    """Return the parts in the order of execution, and the FMUs, with their connections."""
    ports = [port for service in config.services.values() for port in service.ports]
    names = {(port.name, k): name for port in ports for k, name in enumerate(column_names(port))}
    own = {n: _Source(part, n, 1.0) for part in parts for n, c in parts[part].items() if c.kind == kinds.OUTPUT}
    of_fmus = {(c.port, c.column): _Source(f.name, c.element.variable, c.factor) for f in fmus for c in f.outputs}
    computed = {**own, **{names[column]: source for column, source in of_fmus.items()}}
    result = []
    for name, connectors in parts.items():
        inputs = [n for n, c in connectors.items() if c.kind == kinds.INPUT and n in computed]
        result.append(_Component(name, connectors, {n: computed[n] for n in inputs}, ()))
    for fmu in fmus:
        sources = {}
        for c in fmu.inputs:  # ports that Lapwing computes, or outputs of other FMUs
            column = c.port, c.column
            source = of_fmus[column] if c.port.startswith(own_port("")) else own[names[column]]
            sources[c.element.variable] = source._replace(factor=source.factor * c.factor)
        connectors = {
            **{c.element.variable: _Connector(kinds.INPUT, c.element.type) for c in fmu.inputs},
            **{c.element.variable: _Connector(kinds.OUTPUT, c.element.type) for c in fmu.outputs},
        }
        result.append(_Component(fmu.name, connectors, sources, fmu.start))
    return result


def _scene(config: RunConfig, fmus: Sequence[FmuConfig]) -> dict[str, Any]:
    """Return the tables of the scene, whose FMUs are files of the package."""
    scene = dict(config.resolved)
    if fmus:
        tables = {name: {k: v for k, v in table.items() if k != "content"} for name, table in scene["services"].items()}
        scene["services"] = {name: {**table, "fmu": ssp.FMU_PATH.format(name)} for name, table in tables.items()}
    return scene


def _structure(config: RunConfig, components: Sequence[_Component], version: str) -> bytes:
    """Return the system structure description: components and their connections."""
    description, common = (f"{{{each}}}" for each in (ssp.DESCRIPTION, ssp.COMMON))
    Xml.register_namespace("ssd", ssp.DESCRIPTION)
    Xml.register_namespace("ssc", ssp.COMMON)
    Xml.register_namespace("ssv", ssp.VALUES)
    tool = {"generationTool": f"Lapwing {package_version()}"}
    root = Xml.Element(f"{description}SystemStructureDescription", {"version": version, "name": config.scene, **tool})
    system = Xml.SubElement(root, f"{description}System", {"name": config.scene, "description": config.title})
    elements = Xml.SubElement(system, f"{description}Elements")
    for each in components:
        attributes = {"type": ssp.FMU_TYPE, "implementation": "CoSimulation"}
        source = {"source": ssp.FMU_PATH.format(each.name)}
        component = Xml.SubElement(elements, f"{description}Component", {"name": each.name, **attributes, **source})
        own = Xml.SubElement(component, f"{description}Connectors") if each.connectors else component
        for name, connector in each.connectors.items():
            entry = Xml.SubElement(own, f"{description}Connector", {"name": name, "kind": connector.kind})
            if connector.type != _UNTYPED:
                kind = _BOTH_VERSIONS.get(connector.type, connector.type)
                Xml.SubElement(entry, f"{common}{kind}")  # without unit: that of the FMU
        if each.start:
            component.append(_parameters(each.start, version))
        notes = Xml.SubElement(component, f"{description}Annotations")
        note = Xml.SubElement(notes, f"{common}Annotation", {"type": ssp.PART})
        Xml.SubElement(note, "part", {"scene": ssp.SCENE, "name": each.name})
    connections = Xml.SubElement(system, f"{description}Connections")
    for each in components:
        for name, begin in each.sources.items():
            ends = {"startElement": begin.component, "startConnector": begin.connector}
            ends |= {"endElement": each.name, "endConnector": name}
            connection = Xml.SubElement(connections, f"{description}Connection", ends)
            if begin.factor != 1.0:
                Xml.SubElement(connection, f"{common}LinearTransformation", {"factor": repr(begin.factor)})
    stop = {"startTime": "0", "stopTime": repr(config.duration)}
    Xml.SubElement(root, f"{description}DefaultExperiment", stop)
    Xml.indent(root)
    return Xml.tostring(root, "utf-8", xml_declaration=True) + b"\n"


def _parameters(start: Sequence[StartValue], version: str) -> Xml.Element:
    """Return the parameter bindings with the start values of an FMU."""
    description, values = (f"{{{each}}}" for each in (ssp.DESCRIPTION, ssp.VALUES))
    bindings = Xml.Element(f"{description}ParameterBindings")
    binding = Xml.SubElement(bindings, f"{description}ParameterBinding")
    parameters = Xml.SubElement(binding, f"{description}ParameterValues")
    table = Xml.SubElement(parameters, f"{values}ParameterSet", {"version": version, "name": "start"})
    parameters = Xml.SubElement(table, f"{values}Parameters")
    for element, value in start:
        if element.type in ("String", "Binary"):
            kind, text = element.type, str(value)
        elif element.type in ("Real", "Float64", "Float32"):
            kind, text = "Real", repr(float(value))
        elif element.type == "Boolean":
            kind, text = "Boolean", "true" if value else "false"
        else:
            kind, text = "Integer", str(int(value))
        parameter = Xml.SubElement(parameters, f"{values}Parameter", {"name": element.variable})
        Xml.SubElement(parameter, f"{values}{kind}", {"value": text})
    return bindings
