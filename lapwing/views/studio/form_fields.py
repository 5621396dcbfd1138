"""Form of a scene: a field for each key, from the JSON schema and the values of the scene."""

import re
import tomllib
from collections.abc import Iterator
from typing import Any, NamedTuple

from lapwing.cosim.scene import Scene
from lapwing.cosim.scene.load import SCENE_FILE
from lapwing.cosim.scene.toml_text import toml
from lapwing.file_schemas.annotations import Schema, dereference
from lapwing.services.common.firmware.schema import OWN

FIRST = (
    *("trajectory", "effects", "fence", "vehicle", "run", "environment"),
    *("sensors", "autopilot", "solver", "communication"),
)
PER_VEHICLE = ("airframe", "mavlink")  # tables of the single vehicles of a fleet
OPEN = ("run", "vehicle", "effects", "trajectory")  # tables that are initially open
HIDDEN = ("published", "services", "meshes", "ros2")  # tables without influence on the flight, or too large
FIXED = ("run.title", "run.real_time_factor", "vehicle.name")  # keys that the form does not change
EXTENSIBLE = ("effects", "sensors")  # tables to which the form can add tables
PLACED = (  # lists that the 3D view edits, in metres; each is one field
    *("environment.terrain.box", "environment.terrain.cylinder", "fence.keep_in", "fence.keep_out"),
    "trajectory.waypoints",
)
MOST_ITEMS = 40  # largest number of elements with fields in a list of tables
LONGEST = 2000  # largest number of characters of a value in the form
_UNITS = re.compile(r"\[([^\]]*(?:\], \[[^\]]*)*)\]\s*")  # "[m] ...", or "[s], [m] ..." for the elements of a list
_CHANNEL_UNIT = re.compile(r"\bu\b")  # symbol of the unit of the table, in the units of its keys


class Field(NamedTuple):
    """An editable key of a scene."""

    key: str  # dotted key, as in --set
    label: str
    text: str  # value as TOML, or a text without quotes; "" if unset
    kind: str  # "number", "integer", "text", "choice" or "toml"
    unit: str = ""
    meaning: str = ""
    bounds: str = ""  # range as text, e.g. "0 to 1"
    choices: tuple[str, ...] = ()
    default: str = ""


class Group(NamedTuple):
    """A table of a scene: its fields and its subtables."""

    key: str
    label: str
    meaning: str
    fields: tuple[Field, ...]
    groups: tuple["Group", ...]
    open: bool = False

    def all_fields(self) -> Iterator[Field]:
        """Yield the fields of this table and of its subtables."""
        yield from self.fields
        for group in self.groups:
            yield from group.all_fields()


def form(scene: Scene, schema: Schema) -> list[Group]:
    """Return the tables of a scene as groups of fields, the most important ones first."""
    written = tomllib.loads(scene.sources[SCENE_FILE].decode())
    for override in scene.file_overrides or ():  # overrides may add tables
        if isinstance(override.value, dict) and not override.value:
            _table_at(written, override.key)
    resolved = scene.resolved
    member = resolved["vehicle"][0] if scene.vehicles else {}
    tables = {**{name: table for name, table in member.items() if name != "vehicle"}, **resolved}
    if tables.get("autopilot", {}).get("firmware") == OWN:  # others have a fence of their own
        tables.setdefault("fence", {})
    names = [name for name in (*FIRST, *sorted(set(tables) - set(FIRST))) if name in tables and name not in HIDDEN]
    reader = _Reader(schema)
    groups = []
    for name in names:
        part = schema["properties"].get(name)
        if part is None or (scene.vehicles and name in PER_VEHICLE):
            continue
        value = written[name] if name == "vehicle" and scene.vehicles else tables[name]
        group = reader.group(name, name, part, written.get(name), value)
        if group.fields or group.groups:
            groups.append(group._replace(open=name in OPEN))
    return groups


def additions(scene: Scene, schema: Schema) -> list[tuple[str, str]]:
    """Return key and meaning of the tables that can be added: effects and sensors that the scene lacks."""
    present = [vehicle.resolved for vehicle in scene.each_vehicle]
    return [
        (f"{name}.{key}", str(part.get("description", "")))
        for name in EXTENSIBLE
        for key, part in schema["properties"][name]["properties"].items()
        if not any(key in tree.get(name, {}) for tree in present)
    ]


def starting_values(schema: Schema, key: str) -> dict[str, Any]:
    """Return values of the required keys of an added table: neutral ones where the schema allows them."""
    part = schema
    for name in key.split("."):
        part = dereference(schema, part["properties"][name])
    part = next((choice for choice in part.get("anyOf", ()) if "module" not in choice.get("required", ())), part)
    return {name: _starting_value(part["properties"][name]) for name in part.get("required", ())}


def _starting_value(part: Schema) -> Any:
    part = part.get("anyOf", [part])[0]
    if "enum" in part:
        return part["enum"][0]
    if part.get("type") == "array":
        return [_starting_value(part["items"])] * part.get("minItems", 1)
    if part.get("type") == "string":
        return ""
    least, above = part.get("minimum", 0), part.get("exclusiveMinimum", -1)
    value = max(least, 0) if above < 0 else min(above + 1, part.get("maximum", above + 1))
    return int(value) if part.get("type") == "integer" else float(value)


def plain(value: Any) -> str:
    """Return the text of a value in a form: TOML, or a text without quotes."""
    return value if isinstance(value, str) else toml(value)


def _table_at(tree: dict[str, Any], key: str) -> None:
    for part in key.split("."):
        tree = tree.setdefault(part, {}) if isinstance(tree, dict) else {}


class _Reader:
    """Parallel traversal of schema and values."""

    def __init__(self, schema: Schema):
        self._schema = schema

    def group(self, key: str, label: str, part: Schema, written: Any, value: Any, unit: str = "u") -> Group:
        """Return a table.

        Args:
            key: dotted key.
            label: name.
            part: schema of the table.
            written: its content in the scene file.
            value: its content, including all defaults.
            unit: unit of a channel, for the values of its segments.
        """
        unit = _split(part)[0] or unit
        part = self._alternative(part, value if isinstance(value, dict | list) else written)
        fields: list[Field] = []
        groups: list[Group] = []
        meaning = _split(part)[1]
        if isinstance(written, list) and written and isinstance(written[0], dict):  # a list of tables
            items = part.get("items", {})
            resolved = value if isinstance(value, list) and len(value) == len(written) else [{}] * len(written)
            for k, (own, full) in enumerate(zip(written[:MOST_ITEMS], resolved, strict=False)):
                name = str(own.get("name") or own.get("kind") or k + 1)
                shown = _own_values(full, own)
                groups.append(self.group(f"{key}.{k}", f"{label} {name}", items, own, shown, unit))
            return Group(key, label, meaning, (), tuple(groups))
        properties = part.get("properties", {})
        written, value = written if isinstance(written, dict) else {}, value if isinstance(value, dict) else {}
        for name in [*properties, *(name for name in {**value, **written} if name not in properties)]:
            below, inner = f"{key}.{name}", properties.get(name, {})
            own, full = written.get(name), value.get(name)
            if below in PLACED and not (full is None and "phase" in properties):
                items = [
                    {k: v for k, v in item.items() if v not in (None, "")} if isinstance(item, dict) else item
                    for item in full or ()
                ]
                fields.append(Field(below, name, plain(items), "toml", *_split(inner)))
            elif _is_tables(own) or isinstance(own, dict) or (own is None and isinstance(full, dict)):
                group = self.group(below, name, inner, own, full, unit)
                if group.fields or group.groups or isinstance(own, dict):
                    groups.append(group)
            elif not (_is_tables(full) or full == []):
                fields += self._field(below, name, inner, full if own is None else own, unit)
        return Group(key, label, meaning, tuple(fields), tuple(groups))

    def _alternative(self, part: Schema, value: Any) -> Schema:
        """Return the schema's alternative that fits a value, with references resolved."""
        part = dereference(self._schema, part)
        if "anyOf" not in part:
            return part
        choices = [self._alternative(choice, value) for choice in part["anyOf"]]
        fitting = [choice for choice in choices if _fits(choice, value)]
        return {**{k: v for k, v in part.items() if k != "anyOf"}, **(fitting or choices)[0]}

    def _field(self, key: str, label: str, part: Schema, value: Any, channel_unit: str) -> list[Field]:
        text = "" if value is None else plain(value)
        if len(text) > LONGEST:
            return []
        part = self._alternative(part, value)
        if key in FIXED or len(part.get("enum", ())) == 1 or (value is None and _is_table(part)):
            return []  # no choice, or a missing table
        unit, meaning = _split(part)
        unit = _CHANNEL_UNIT.sub(channel_unit, unit)
        kind = {"number": "number", "integer": "integer", "string": "text", "boolean": "choice"}.get(
            str(part.get("type", "")), "toml"
        )
        choices: tuple[str, ...] = ("true", "false") if part.get("type") == "boolean" else ()
        if "enum" in part:
            kind, choices = "choice", tuple(map(str, part["enum"]))
        if isinstance(value, str) and kind == "toml":
            kind = "text"
        if kind == "choice" and text not in choices:
            choices = (text, *choices)
        default = plain(part["default"]) if part.get("default") not in (None, "") else ""
        return [Field(key, label, text, kind, unit, meaning, _bounds(part), choices, default)]


def _split(part: Schema) -> tuple[str, str]:
    """Return unit and meaning of a description."""
    description = str(part.get("description", ""))
    match = _UNITS.match(description)
    if not match:
        return "", description
    return match[1].replace("], [", ", ").replace("^2", "²").replace("^3", "³"), description[match.end() :]


def _bounds(part: Schema) -> str:
    """Return the range of a number, or of the numbers of a list, as text."""
    items = part.get("items", {})
    part = items if isinstance(items, dict) and part.get("type") == "array" else part
    low, above = part.get("minimum"), part.get("exclusiveMinimum")
    high, below = part.get("maximum"), part.get("exclusiveMaximum")
    least = f"{low:g}" if low is not None else f"above {above:g}" if above is not None else ""
    most = f"{high:g}" if high is not None else f"below {below:.3g}" if below is not None and below < 2**63 else ""
    if least and most:
        return f"{least} to {most}"
    return (f"at least {least}" if low is not None else least) or (f"at most {most}" if high is not None else most)


def _fits(choice: Schema, value: Any) -> bool:
    kind = choice.get("properties", {}).get("kind", {}).get("enum")
    if kind is not None:
        return isinstance(value, dict) and value.get("kind") in kind
    types = {dict: "object", list: "array", str: "string", bool: "boolean", int: "integer", float: "number"}
    return choice.get("type") == types.get(type(value)) or (type(value) is int and choice.get("type") == "number")


def _is_table(part: Schema) -> bool:
    """Return True for the schema of a table, also one that `false` switches off, or of a list of tables."""
    return "object" in part.get("type", ()) or (part.get("type") == "array" and _is_table(part.get("items", {})))


def _is_tables(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and isinstance(value[0], dict)


def _own_values(full: Any, own: dict[str, Any]) -> dict[str, Any]:
    """Return the resolved values of a table; a list of one table counts as the table if the file has a table."""
    if not isinstance(full, dict):
        return {}
    return {
        name: item[0] if _is_tables(item) and isinstance(own.get(name), dict) else item for name, item in full.items()
    }
