"""JSON schemas of the TOML files that users write (scenes, airframes, gain sets), and the units of their keys."""

import re
from collections.abc import Callable, Iterable, Iterator
from types import ModuleType
from typing import Any

from lapwing.cosim.scene import SceneTable
from lapwing.cosim.scene.vehicle_scenes import MAX_VEHICLES
from lapwing.dynamics import effects, integrators
from lapwing.dynamics.units import UNITS
from lapwing.dynamics.vehicles.airframe import Airframe
from lapwing.file_schemas import descriptions
from lapwing.file_schemas.annotations import Schema, closed_table, dereference, required_keys, table_schema
from lapwing.services.autopilot import gains
from lapwing.services.autopilot.gains import GainSet
from lapwing.services.common import autopilot_parameters
from lapwing.services.common.autopilot_parameters import Parameter
from lapwing.services.common.schemas.place_schema import PlaceTable
from lapwing.services.plant import models
from lapwing.services.scene_resolver import load, vocabulary
from lapwing.services.sensors.fault_schedule import SLOTS, FaultTable
from lapwing.services.sensors.schema import sensors
from lapwing.services.trajectory.segments import KINDS
from lapwing.services.trajectory.trajectory_compiler import CHANNELS
from lapwing.services.trajectory.waypoints import Waypoint

DRAFT = "http://json-schema.org/draft-07/schema#"
TEXT: Schema = {"type": "string"}
OWN: Schema = {
    "type": "object",
    "description": "user-defined, with its own parameters",
    "properties": {"module": {**TEXT, "description": "name of the module that declares it"}},
    "required": ["module"],
}
USER_SEGMENT: Schema = {
    **OWN,
    "properties": {**OWN["properties"], "kind": {**TEXT, "description": "name of the segment in the module"}},
    "required": ["kind", "module"],
}


def sensor_tables() -> dict[str, tuple[ModuleType, type]]:
    """Return (module, parameter class) of every sensor, by name."""
    return {name: (module, type(next(iter(module.PRESETS.values())))) for name, module in sensors().items()}


OWN_FIRMWARE = "lapwing"
FIRMWARE_PARAMETERS = {"description": "values by name, or the name of a file of them", "type": ["object", "string"]}


def flight_parameters() -> tuple[list[Parameter], list[Parameter]]:
    """Return the autopilot's parameters: those that all gain sets share, and those that depend on the gain set."""
    tables = [autopilot_parameters.table(load("hover", {"autopilot.gains": name})) for name in gains.names()]
    first, *others = tables
    fixed = [p for name, p in first.items() if all(table[name] == p for table in others)]
    return fixed, [p for p in first.values() if p not in fixed]


def scene_schema() -> Schema:
    """Return the JSON schema of a scene file, without the content of the files that it names."""
    # omits tables without own keys
    sections = {name: s for name, s in vocabulary().sections.items() if s.model_fields or not s.FROM_FILE}
    tables = {name: _section(section) for name, section in sections.items()}
    tables["effects"] |= _or_own({name: _effect(name) for name in effects.names()})
    tables["sensors"] |= _or_own({name: _sensor(name, module, cls) for name, (module, cls) in sensor_tables().items()})
    tables["solver"]["properties"]["integrator"]["enum"] = integrators.names()
    tables["vehicle"]["properties"]["model"]["enum"] = list(models.names())
    tables["autopilot"]["properties"]["parameters"] = FIRMWARE_PARAMETERS
    own_autopilot = {"properties": {"firmware": {"const": OWN_FIRMWARE}}}
    tables["autopilot"] |= {"if": own_autopilot, "then": {"properties": {"parameters": _parameters()}}}
    for name, section in sections.items():
        if section.FROM_FILE:  # the keys of a scene override those of the file
            tables[name] = _optional(tables[name])
    del tables["trajectory"]["required"]
    tables["trajectory"]["oneOf"] = [required_keys([key]) for key in ("phase", "waypoints")]
    points = tables["trajectory"]["properties"]["waypoints"]
    in_metres = points["items"] | {"description": "[m] x, y, z; a fourth number is the yaw in rad"}
    points["items"] = {"anyOf": [in_metres, table_schema(Waypoint)]}
    for areas in tables["fence"]["properties"].values():
        area = areas["items"]["properties"]
        area["position"] = _in_metres_or_place(area["position"])
        area["corners"]["items"] = _in_metres_or_place(area["corners"]["items"])
    phase = tables["trajectory"]["properties"]["phase"]["items"]["properties"]
    segment = {"$ref": "#/definitions/segment"}
    for channel in CHANNELS:
        unit = "rad" if channel == "yaw" else "m"
        phase[channel] = {
            "description": f"[{unit}] a segment, or a list of them",
            "anyOf": [segment, {"type": "array", "items": segment}],
        }
    for axis, figure in tables["published"]["properties"]["rmse"]["properties"].items():
        figure["description"] = f"published tracking error {'along this axis, in m' if axis in 'xyz' else 'in rad'}"
    vehicles = [tables["vehicle"], _fleet(tables, sections)]
    tables["vehicle"] = {"description": vehicles[0]["description"], "anyOf": vehicles}
    needed = [name for name, table in tables.items() if "required" in table and not sections[name].OPTIONAL]
    result = {**_head("Lapwing scene"), **closed_table(tables), **required_keys(needed)}
    return {**result, "definitions": {"segment": {"anyOf": [*map(_segment, KINDS), USER_SEGMENT]}}}


def _in_metres_or_place(pair: Schema) -> Schema:
    """Return the schema of a place: two numbers [m], or a table."""
    return {"description": pair.get("description", "[m] x, y"), "anyOf": [pair, table_schema(PlaceTable)]}


def airframe_schema() -> Schema:
    """Return the JSON schema of an airframe file."""
    return {**_head("Lapwing airframe"), **table_schema(Airframe)}


def gains_schema() -> Schema:
    """Return the JSON schema of a gain set file."""
    return {**_head("Lapwing gain set"), **table_schema(GainSet)}


def with_units(node: Any, unit: str = "") -> Any:
    """Return a schema in which numbers may be texts with a unit, such as "30 deg", and keys of angles end in `_deg`.

    `unit` is that of the whole node.
    """
    if isinstance(node, list):
        return [with_units(item) for item in node]
    if not isinstance(node, dict):
        return node
    unit = node["description"][1:].partition("]")[0] if str(node.get("description")).startswith("[") else unit
    inner = {key: with_units(value, unit if key == "items" else "") for key, value in node.items() if key != "default"}
    if "default" in node:
        inner["default"] = node["default"]
    if node.get("type") == "number" and unit in UNITS:
        names = "|".join(map(re.escape, UNITS[unit]))
        inner |= {"type": ["number", "string"], "pattern": rf"^[+-]?[0-9.]+(e[+-]?[0-9]+)? *({names})$"}
    for name, part in node.get("properties", {}).items():
        if part.get("type") == "number" and part.get("description", "").startswith(("[rad]", "[u]")):
            in_degrees = {"type": "number", "description": f"[deg] {name} in degrees"}
            inner["properties"][f"{name}_deg"] = with_units(in_degrees)
            either: Schema = {"not": {"required": [name, f"{name}_deg"]}}
            if name in node.get("required", ()):
                inner["required"] = [other for other in inner["required"] if other != name]
                either = {"oneOf": [required_keys([name]), required_keys([f"{name}_deg"])]}
            inner["allOf"] = [*inner.get("allOf", ()), either]
    return inner


SCHEMAS: dict[str, Callable[[], Schema]] = {
    "scene": lambda: with_units(scene_schema()),
    "airframe": lambda: with_units(airframe_schema()),
    "gains": gains_schema,
}
"""Functions that return the schema of a kind of file, for editors."""


def _head(title: str) -> Schema:
    return {"$schema": DRAFT, "title": title}


def _section(section: type[SceneTable]) -> Schema:
    return {"description": " ".join((section.__doc__ or "").split()), **table_schema(section)}


def _fleet(tables: Schema, sections: dict[str, type[SceneTable]]) -> Schema:
    """Return the schema of a list of vehicles, each with the keys of a vehicle and the tables that are not shared."""
    names = [name for name, section in sections.items() if name != "vehicle" and not section.SHARED]
    own = {name: _partial(tables[name], f"#/properties/{name}") for name in names}
    properties = dict(tables["vehicle"]["properties"])
    text = "airframe file, or keys that override those of the scene's airframe"
    properties["airframe"] = {"description": text, "anyOf": [properties["airframe"], own.pop("airframe")]}
    items = closed_table({**properties, **own})
    text = "several vehicles: the tables of each override those of the scene"
    return {"type": "array", "minItems": 1, "maxItems": MAX_VEHICLES, "items": items, "description": text}


def _partial(schema: Schema, place: str) -> Schema:
    """Return a part of the schema without required keys, by reference if it has none."""
    optional: Schema = _optional(schema)
    if optional == schema:
        return {"$ref": place}
    if "properties" in schema:
        inner = {key: _partial(value, f"{place}/properties/{key}") for key, value in schema["properties"].items()}
        return {**optional, "properties": inner}
    return optional


def _or_own(tables: dict[str, Schema]) -> Schema:
    """Return the schema of these tables, or false, and of user-defined ones, which name a module."""
    or_false = {"type": ["object", "boolean"], "not": {"const": True}}
    return {
        **closed_table({name: {**table, **or_false} for name, table in tables.items()}),
        "additionalProperties": OWN,
    }


def _effect(name: str) -> Schema:
    return {"description": descriptions.effect(name), **table_schema(descriptions.effect_settings(name))}


def _sensor(name: str, module: Any, cls: type) -> Schema:
    """Return the schema of a sensor: a preset, keys that differ from it, and faults where it has channels."""
    about = "; ".join(f"{preset}: {text}" for preset, text in descriptions.presets(name, module).items())
    preset = {"description": about, "enum": list(module.PRESETS), "default": next(iter(module.PRESETS))}
    table = table_schema(cls, leave_out=["faults"])
    _remove_defaults(table, list(module.PRESETS.values()))
    properties = {"preset": preset, **table["properties"]}
    if hasattr(module, "CHANNELS"):
        fault = table_schema(FaultTable)
        fault["properties"]["channel"] |= {"enum": ["all", *module.CHANNELS], "default": "all"}
        text = "faults by schedule"
        properties["faults"] = {"type": "array", "items": fault, "maxItems": SLOTS, "description": text}
    return {"description": descriptions.sensor(module), **closed_table(properties)}


def _remove_defaults(table: Schema, presets: list[Any]) -> None:
    """Remove the defaults of keys that depend on the preset."""
    for key, node in table["properties"].items():
        values = [getattr(preset, key, None) for preset in presets]
        if "properties" in node:
            _remove_defaults(node, values)
        elif any(value != values[0] for value in values):
            node.pop("default", None)


def _parameters() -> Schema:
    """Return the schema of the autopilot's parameters: values by name, or the name of a file."""
    fixed, by_gains = flight_parameters()
    properties = {p.name: _parameter(p) for p in fixed} | {
        p.name: {"type": "number", "description": f"{p.meaning}; default: that of the gain set"} for p in by_gains
    }
    return {"description": "values by name, or the name of a file of them", "anyOf": [closed_table(properties), TEXT]}


def _parameter(p: Parameter) -> Schema:
    kind = "integer" if p.integer else "number"
    unit = f"[{p.unit}] " if p.unit else ""
    return {"type": kind, "minimum": p.least, "maximum": p.most, "default": p.default, "description": unit + p.meaning}


def _segment(kind: str) -> Schema:
    """Return the schema of a segment of one kind; the points of a table may be in a file."""
    table = table_schema(KINDS[kind])
    table["description"] = " ".join((KINDS[kind].__doc__ or "").split())
    table["properties"]["kind"] = {"enum": [kind], "description": "kind of the segment"}
    needed = [name for name in table.get("required", []) if name != "points"]
    return {**table, "required": ["kind", *needed]}


def _optional(schema: Any) -> Any:
    """Return a schema without required keys."""
    if isinstance(schema, dict):
        return {key: _optional(value) for key, value in schema.items() if key != "required"}
    return schema


UNIT = re.compile(r"\[([^\]]+)\]")
FILES = ("airframe", "gains")  # files that a scene names; the name is the first part of their keys


def key_units(keys: Iterable[str]) -> dict[str, str]:
    """Return the unit of each dotted key that has one: {"vehicle.mass": "kg"}."""
    schemas = {name: SCHEMAS[name]() for name in ("scene", *FILES)}
    units = {}
    for key in keys:
        first, _, rest = key.partition(".")
        name, path = (first, rest) if first in FILES else ("scene", key)
        for node in _nodes(schemas[name], schemas[name], path.split(".")):
            if (unit := UNIT.match(node.get("description", ""))) and "," not in unit[1]:
                units[key] = unit[1]
                break
    return units


def _nodes(whole: dict[str, Any], node: dict[str, Any], path: list[str]) -> Iterator[dict[str, Any]]:
    """Yield the schemas at the end of a path, through all alternatives."""
    node = dereference(whole, node)
    if not path:
        yield node
    elif path[0] in node.get("properties", {}):
        yield from _nodes(whole, node["properties"][path[0]], path[1:])
    elif path[0].isdigit() and isinstance(node.get("items"), dict):
        yield from _nodes(whole, node["items"] | {"description": node.get("description", "")}, path[1:])
    for other in (*node.get("anyOf", ()), *node.get("oneOf", ()), *node.get("allOf", ())):
        yield from _nodes(whole, other, path)
