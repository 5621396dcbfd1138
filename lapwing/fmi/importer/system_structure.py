"""Scenes from System Structure and Parameterization packages, whose components are FMUs and Lapwing parts.

An annotation `PART` of the components that Lapwing exported, or a component of type `SCENE_TYPE`, names the scene. Such
components keep its connections; its parts run natively. Each other FMU becomes a table `[services.NAME]`.
"""

import base64
import json
import re
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree as Xml

from lapwing.cosim.scene import SceneError
from lapwing.cosim.scene.scene_error import KeyOrigin

_BASE = "http://ssp-standard.org/SSP1/SystemStructure"
DESCRIPTION, COMMON, VALUES = f"{_BASE}Description", f"{_BASE}Common", f"{_BASE}ParameterValues"
STRUCTURE, SCENE = "SystemStructure.ssd", "resources/scene.json"
FMU_PATH = "resources/{}.fmu"  # FMU of a service in a package from Lapwing
PART = "org.lapwing.part"  # type of the annotation
FMU_TYPE, SCENE_TYPE = "application/x-fmu-sharedlibrary", "application/x-lapwing-scene"
LARGEST = 500_000_000  # [bytes] limit of a file in a package
_NAMES = {"d": DESCRIPTION, "c": COMMON, "v": VALUES}


class _Part(NamedTuple):
    scene: str  # paths in the package
    source: str


class _Fmu(NamedTuple):
    source: str  # path in the package
    start: dict[str, float | str]
    inputs: dict[str, str]
    outputs: dict[str, str]


class _End(NamedTuple):
    element: str  # name of a component or system
    connector: str


class _Content(NamedTuple):
    parts: dict[str, _Part]
    fmus: dict[str, _Fmu]
    systems: set[str]  # names of the systems in the system
    sources: dict[_End, _End]  # source of each connection by its target


class _Package:
    """Open package."""

    def __init__(self, path: Path, archive: zipfile.ZipFile):
        self.path, self._archive = path, archive

    def error(self, message: str, expected: str) -> SceneError:
        return SceneError("", message, expected, KeyOrigin(self.path))

    def read(self, name: str) -> bytes:
        """Return a file of the package. Raise SceneError if it is missing or too large."""
        try:
            if self._archive.getinfo(name).file_size > LARGEST:
                raise self.error(f"{name} is larger than {LARGEST / 1e6:g} MB", "a smaller file")
            return self._archive.read(name)
        except KeyError:
            raise self.error(f"has no file {name}", "a package with the files that it names") from None

    def xml(self, name: str) -> Xml.Element:
        """Return the root of an XML file."""
        text = self.read(name)
        if b"<!DOCTYPE" in text or b"<!ENTITY" in text:
            raise self.error(f"{name} declares a document type", "XML without entities")
        try:
            return Xml.fromstring(text)
        except Xml.ParseError as error:
            raise self.error(f"{name} is not XML: {error}", "a system structure description") from None


def scene_of_package(path: Path, parse: Callable[[Path, str], Any]) -> dict[str, Any]:
    """Return the tables of the scene of a package, with its FMUs embedded.

    Args:
        path: path of the package.
        parse: function that returns the resolved tables of a scene in TOML.

    Raises:
        SceneError: not a package, or a component or connection that cannot be used.
    """
    origin = KeyOrigin(path)
    try:
        with zipfile.ZipFile(path) as archive:
            return _tables(_Package(path, archive), parse)
    except (OSError, zipfile.BadZipFile) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise SceneError("", f"not a package: {reason.lower()}", "an SSP file", origin) from None


def _tables(package: _Package, parse: Callable[[Path, str], Any]) -> dict[str, Any]:
    root = package.xml(STRUCTURE)
    if not re.match(r"[12]\.", version := root.get("version", "")):
        raise package.error(f"SSP version {version or 'missing'}", "version 1.0 or 2.0")
    system = root.find("d:System", _NAMES)
    if system is None or system.find("d:Elements", _NAMES) is None:
        raise package.error("has no components", "a system of FMUs and Lapwing parts")
    content = _Content({}, {}, set(), {})
    _flatten(package, system, "", content)
    parts, fmus = content.parts, content.fmus
    if len(scenes := {part.scene for part in parts.values()}) != 1:
        number = f"{len(scenes)} scenes" if scenes else "no Lapwing part"
        raise package.error(f"has {number}", "Lapwing parts of one scene, such as `lapwing export-ssp` writes")
    (scene,) = scenes
    tree = _scene(package, scene, parse)
    services = table if isinstance(table := tree.get("services"), dict) else {}
    own = {name: t for name, t in services.items() if isinstance(t, dict) and t.get("fmu") == FMU_PATH.format(name)}
    for end, start in content.sources.items():
        if end.element not in content.systems:
            _connect(_component_source(package, content, start), end, fmus, own)
    for name in own.keys() - parts.keys():
        del services[name]  # removed from the package, or replaced
    tables = {name: (part.source, own[name]) for name, part in parts.items() if name in own}
    for name, fmu in fmus.items():
        if not name.isidentifier():
            raise package.error(f"component {name!r}", "names of letters, digits and underscores")
        tables[name] = fmu.source, {key: value for key, value in fmu._asdict().items() if key != "source" and value}
    for name, (source, table) in tables.items():
        encoded = base64.b64encode(package.read(source)).decode()
        services[name] = {**table, "fmu": f"{package.path}/{source}", "content": encoded}
    return {**tree, "services": services} if services else tree


def _flatten(package: _Package, system: Xml.Element, prefix: str, content: _Content) -> None:
    """Add the components and connections of a system and its subsystems; `prefix` is the name of the system."""
    for element in system.iterfind("d:Elements/*", _NAMES):
        name, tag = _joined(prefix, element.get("name", "")), element.tag.rpartition("}")[2]
        if name in {*content.parts, *content.fmus, *content.systems}:
            raise package.error(f"two elements have the name {name}", "different names")
        if tag == "Component":
            _sort(package, element, name, content.parts, content.fmus)
        elif tag != "System":
            raise package.error(f"{name} is a {tag}", "components and systems")
        elif element.find("d:ParameterBindings", _NAMES) is not None:
            raise package.error(f"system {name} has parameter bindings", "parameters of its components")
        else:
            content.systems.add(name)
            _flatten(package, element, name, content)
    _connections(package, system, prefix, content)


def _joined(prefix: str, name: str) -> str:
    """Return the name of an element of a system: "drive_motor" for the component `motor` of the system `drive`."""
    return "_".join(filter(None, (prefix, name)))


def _sort(package: _Package, component: Xml.Element, name: str, parts: dict[str, _Part], fmus: dict[str, _Fmu]) -> None:
    """Add a component to `parts` or `fmus`."""
    kind, source = component.get("type", FMU_TYPE), component.get("source", "")
    note = component.find(f"d:Annotations/c:Annotation[@type='{PART}']/part", _NAMES)
    if note is not None or kind == SCENE_TYPE:
        parts[name] = _Part(note.get("scene", SCENE) if note is not None else source, source)
    elif kind == FMU_TYPE:
        fmus[name] = _Fmu(source, _start(package, component), {}, {})
    else:
        raise package.error(f"component {name} has the type {kind}", f"{FMU_TYPE} or {SCENE_TYPE}")


def _start(package: _Package, component: Xml.Element) -> dict[str, float | str]:
    """Return the start values of an FMU from parameter bindings in the package or in its files."""
    result: dict[str, float | str] = {}
    for binding in component.iterfind("d:ParameterBindings/d:ParameterBinding", _NAMES):
        if binding.find("d:ParameterMapping", _NAMES) is not None:
            message = f"component {component.get('name')} has a parameter mapping"
            raise package.error(message, "parameters that are named as in the FMU")
        source, prefix = binding.get("source"), binding.get("prefix", "")
        sets = [package.xml(source)] if source else binding.iterfind("d:ParameterValues/v:ParameterSet", _NAMES)
        for each in sets:
            for parameter in each.iterfind("v:Parameters/v:Parameter", _NAMES):
                text, kind = next(((v.get("value", ""), v.tag) for v in parameter), ("", ""))
                try:
                    number = {"true": 1.0, "false": 0.0}.get(text)
                    is_text = kind.endswith(("}String", "}Binary"))
                    value = text if is_text else float(text) if number is None else number
                    result[prefix + parameter.get("name", "")] = value
                except ValueError:
                    message = f"parameter {parameter.get('name')} has the value {text!r}"
                    raise package.error(message, "a number, true or false") from None
    return result


def _connections(package: _Package, system: Xml.Element, prefix: str, content: _Content) -> None:
    """Add the connections of a system."""
    for connection in system.iterfind("d:Connections/d:Connection", _NAMES):
        start, end = (
            _End(_joined(prefix, connection.get(f"{side}Element", "")), connection.get(f"{side}Connector", ""))
            for side in ("start", "end")
        )
        for each in (start, end):
            if each.element not in {*content.parts, *content.fmus, *content.systems}:
                message = f"a connection of {each.element or 'the system itself'}"
                raise package.error(message, "connections between the components")
        transforms = any(child.tag.endswith("Transformation") for child in connection)
        if transforms and {start.element, end.element} & content.fmus.keys():
            message = f"the connection to {end.element}.{end.connector} transforms values"
            raise package.error(message, "a connection without transformation")
        content.sources[end] = start


def _component_source(package: _Package, content: _Content, start: _End) -> _End:
    """Return the output of a component at the start of a connection, also through connectors of systems."""
    passed = set()
    while start.element in content.systems:
        if start not in content.sources or start in passed:
            message = f"connector {start.connector} of system {start.element} has no source"
            raise package.error(message, "a connection from a component")
        passed.add(start)
        start = content.sources[start]
    return start


def _connect(start: _End, end: _End, fmus: dict[str, _Fmu], own: Mapping[str, Any]) -> None:
    """Add a connection to the table of its FMU; `own` FMUs and Lapwing parts have the connections of the scene."""
    if end.element in fmus:
        is_fmu = start.element in fmus or start.element in own
        source = f"{start.element}.{start.connector}" if is_fmu else _column(start.connector)
        fmus[end.element].inputs[end.connector] = source
    elif start.element in fmus and end.element not in own:
        fmus[start.element].outputs[_column(end.connector)] = start.connector


def _column(connector: str) -> str:
    """Return the name of a column in a scene: "truth.position_world[0]" is "truth.position_world.0"."""
    return re.sub(r"\[([\d,]+)\]", lambda match: "." + match[1].replace(",", "."), connector)


def _scene(package: _Package, name: str, parse: Callable[[Path, str], Any]) -> dict[str, Any]:
    text = package.read(name)
    try:
        tree = (
            json.loads(text) if name.endswith(".json") else parse(package.path.parent / Path(name).name, text.decode())
        )
    except UnicodeDecodeError:
        raise package.error(f"{name} is not UTF-8 text", "a scene") from None
    except json.JSONDecodeError as error:
        raise package.error(f"{name} is not JSON: {error}", "a scene that `lapwing export-ssp` wrote") from None
    if not isinstance(tree, dict) or tree.get("modules"):
        raise package.error(f"{name} has Python modules, or is no table", "a scene without modules")
    return dict(tree)
