"""Units of the keys of a scene, from the JSON schemas of scene, airframe and gain set."""

import re
from collections.abc import Iterable, Iterator
from typing import Any

from lapwing.file_schemas.annotations import dereference
from lapwing.file_schemas.json_schema import SCHEMAS

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
