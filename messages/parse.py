"""ROS 2 message definitions: from the text of a `.msg` file to fields, constants and dependencies."""

import re
from pathlib import Path
from typing import Any, NamedTuple

# ROS 2 primitive -> struct format character; the character's size is also its alignment in CDR.
PRIMITIVES = {
    "bool": "?",
    "byte": "B",
    "char": "B",
    "int8": "b",
    "uint8": "B",
    "int16": "h",
    "uint16": "H",
    "int32": "i",
    "uint32": "I",
    "int64": "q",
    "uint64": "Q",
    "float32": "f",
    "float64": "d",
}

_LINE = re.compile(
    r"(?P<base>[A-Za-z][\w/]*)(?P<array>\[\d*\])?\s+(?P<name>[A-Za-z]\w*)\s*(?:=\s*(?P<constant>.+)|(?P<default>.+))?"
)


class Field(NamedTuple):
    """One field: `length` is None for a single value, 0 for a sequence (`T[]`), n for an array (`T[n]`)."""

    base: str  # primitive, "string" or full type name
    name: str
    length: int | None
    default: Any  # of a single primitive or string, else None

    @property
    def nested(self) -> bool:
        """True if the elements are messages."""
        return "/" in self.base


class Definition(NamedTuple):
    """One parsed message type."""

    type_name: str  # "sensor_msgs/msg/Imu"
    fields: tuple[Field, ...]
    constants: dict[str, Any]
    text: str


def parse(type_name: str, text: str) -> Definition:
    """Parse the text of one message type.

    Bounded strings and sequences, wide strings, and arrays of anything but primitives are not supported.

    Raises:
        ValueError: a line is neither a field nor a constant, or uses an unsupported construct.
    """
    package = type_name.split("/")[0]
    fields: list[Field] = []
    constants: dict[str, Any] = {}
    for number, line in enumerate(text.splitlines(), start=1):
        code = line.split("#", 1)[0].strip()
        if not code:
            continue
        match = _LINE.fullmatch(code)
        if match is None:
            raise ValueError(f"{type_name}, line {number}: expected `type name`, `type[n] name` or a constant: {code}")
        base = _full_name(match["base"], package)
        length = None if match["array"] is None else int(match["array"][1:-1] or 0)
        if length and base not in PRIMITIVES:
            raise ValueError(f"{type_name}, line {number}: arrays of fixed length hold primitives only: {code}")
        if match["constant"] is not None:
            constants[match["name"]] = _value(base, match["constant"])
            continue
        default = None if "/" in base or length is not None else _value(base, match["default"])
        fields.append(Field(base, match["name"], length, default))
    return Definition(type_name, tuple(fields), constants, text)


def read_folder(folder: Path) -> dict[str, Definition]:
    """Read every `<package>/<Name>.msg` under a folder, by full type name, each after the types that it contains.

    Raises:
        ValueError: a definition is invalid, or contains a type without a file.
    """
    result = {}
    for path in sorted(folder.glob("*/*.msg")):
        type_name = f"{path.parent.name}/msg/{path.stem}"
        result[type_name] = parse(type_name, path.read_text(encoding="utf-8"))
    ordered: dict[str, Definition] = {}
    for type_name in result:
        for name in [*reversed(dependencies(type_name, result)), type_name]:
            ordered.setdefault(name, result[name])
    return ordered


def dependencies(type_name: str, definitions: dict[str, Definition]) -> list[str]:
    """Return the full names of all types contained in a type, each before the types that it contains."""
    names: list[str] = []
    for field in definitions[type_name].fields:
        if not field.nested:
            continue
        if field.base not in definitions:
            raise ValueError(f"{type_name}: field {field.name} has type {field.base}, which has no .msg file")
        for name in [field.base, *dependencies(field.base, definitions)]:
            if name in names:
                names.remove(name)
            names.append(name)
    return names


def schema_text(type_name: str, definitions: dict[str, Definition]) -> str:
    """Return the text of a type followed by those of all contained types, in MCAP's schema encoding `ros2msg`."""
    parts = [definitions[type_name].text]
    for name in dependencies(type_name, definitions):
        parts.append(f"{'=' * 80}\nMSG: {name.replace('/msg/', '/')}\n{definitions[name].text}")
    return "".join(parts)


def _full_name(base: str, package: str) -> str:
    if base in PRIMITIVES or base == "string":
        return base
    owner, _, name = base.rpartition("/")
    return f"{owner.removesuffix('/msg') or package}/msg/{name}"


def _value(base: str, text: str | None) -> Any:
    if base == "string":
        return (text or "").strip().strip("\"'")
    if base == "bool":
        return (text or "false").strip().lower() in ("true", "1")
    return float(text or 0) if base.startswith("float") else int(text or 0)
