"""Scenes from System Structure and Parameterization packages, whose components are FMUs and Lapwing parts.

The package names its scene: in an annotation `PART` of the components that Lapwing exported, or as a component of the
type `SCENE_TYPE`. Lapwing's own parts run natively and keep the connections of the scene. Each other FMU becomes a
table `[services.NAME]` with the connections that it has.
"""

import base64
import json
import re
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree as Xml

from lapwing.cosim.scene import SceneError
from lapwing.cosim.scene.scene_error import KeyOrigin

_BASE = "http://ssp-standard.org/SSP1/SystemStructure"
DESCRIPTION, COMMON, VALUES = f"{_BASE}Description", f"{_BASE}Common", f"{_BASE}ParameterValues"
STRUCTURE, SCENE = "SystemStructure.ssd", "resources/scene.json"
PART = "org.lapwing.part"  # type of the annotation
FMU_TYPE, SCENE_TYPE = "application/x-fmu-sharedlibrary", "application/x-lapwing-scene"
LARGEST = 500_000_000  # [bytes] of a file in a package
_NAMES = {"d": DESCRIPTION, "c": COMMON, "v": VALUES}


class _Part(NamedTuple):
    scene: str  # path of the scene in the package


class _Fmu(NamedTuple):
    source: str  # path in the package
    start: dict[str, float]
    inputs: dict[str, str]
    outputs: dict[str, str]


class _Package:
    """An open package."""

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
        path: of the package.
        parse: returns the resolved tables of a scene in TOML.

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
    elements = system.find("d:Elements", _NAMES) if system is not None else None
    if system is None or elements is None:
        raise package.error("has no components", "a system of FMUs and Lapwing parts")
    parts: dict[str, _Part] = {}
    fmus: dict[str, _Fmu] = {}
    for component in elements:
        name = component.get("name", "")
        if component.tag != f"{{{DESCRIPTION}}}Component":
            raise package.error(f"{name} is a {component.tag.rpartition('}')[2]}", "components, without systems in it")
        _sort(package, component, name, parts, fmus)
    scenes = dict.fromkeys(part.scene for part in parts.values())
    if len(scenes) != 1:
        number = f"{len(scenes)} scenes" if scenes else "no Lapwing part"
        raise package.error(f"has {number}", "Lapwing parts of one scene, such as `lapwing export-ssp` writes")
    for connection in system.iterfind("d:Connections/d:Connection", _NAMES):
        _connect(package, connection, parts, fmus)
    (scene,) = scenes
    tree = _scene(package, scene, parse)
    for name, fmu in fmus.items():
        if not name.isidentifier():
            raise package.error(f"component {name!r}", "names of letters, digits and underscores")
        own = {key: value for key, value in fmu._asdict().items() if key != "source" and value}
        content = base64.b64encode(package.read(fmu.source)).decode()
        tree.setdefault("services", {})[name] = {"fmu": f"{package.path}/{fmu.source}", "content": content, **own}
    return tree


def _sort(package: _Package, component: Xml.Element, name: str, parts: dict[str, _Part], fmus: dict[str, _Fmu]) -> None:
    """Put a component into `parts` or `fmus`."""
    kind, source = component.get("type", FMU_TYPE), component.get("source", "")
    note = component.find(f"d:Annotations/c:Annotation[@type='{PART}']/part", _NAMES)
    if note is not None or kind == SCENE_TYPE:
        parts[name] = _Part(note.get("scene", SCENE) if note is not None else source)
    elif kind == FMU_TYPE:
        fmus[name] = _Fmu(source, _start(package, component), {}, {})
    else:
        raise package.error(f"component {name} has the type {kind}", f"{FMU_TYPE} or {SCENE_TYPE}")


def _start(package: _Package, component: Xml.Element) -> dict[str, float]:
    """Return the start values that parameter bindings give an FMU, in the package or in files of it."""
    result = {}
    for binding in component.iterfind("d:ParameterBindings/d:ParameterBinding", _NAMES):
        if binding.find("d:ParameterMapping", _NAMES) is not None:
            message = f"component {component.get('name')} has a parameter mapping"
            raise package.error(message, "parameters that are named as in the FMU")
        source, prefix = binding.get("source"), binding.get("prefix", "")
        sets = [package.xml(source)] if source else binding.iterfind("d:ParameterValues/v:ParameterSet", _NAMES)
        for each in sets:
            for parameter in each.iterfind("v:Parameters/v:Parameter", _NAMES):
                text = next((value.get("value", "") for value in parameter), "")
                try:
                    number = {"true": 1.0, "false": 0.0}.get(text)
                    result[prefix + parameter.get("name", "")] = float(text) if number is None else number
                except ValueError:
                    message = f"parameter {parameter.get('name')} has the value {text!r}"
                    raise package.error(message, "a number, true or false") from None
    return result


def _connect(package: _Package, connection: Xml.Element, parts: dict[str, _Part], fmus: dict[str, _Fmu]) -> None:
    """Enter a connection into the table of its FMU; those between Lapwing parts are those of the scene."""
    start, end = connection.get("startElement", ""), connection.get("endElement", "")
    source, target = connection.get("startConnector", ""), connection.get("endConnector", "")
    for element in (start, end):
        if element not in parts and element not in fmus:
            message = f"a connection of {element or 'the system itself'}"
            raise package.error(message, "connections between the components")
    if any(child.tag.endswith("Transformation") for child in connection):
        raise package.error(
            f"the connection to {end}.{target} transforms values", "a connection without transformation"
        )
    if end in fmus:
        fmus[end].inputs[target] = f"{start}.{source}" if start in fmus else _column(source)
    elif start in fmus:
        fmus[start].outputs[_column(target)] = source


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
