"""JSON schema (draft 7, which TOML editors read) of an annotation with its bounds."""

import math
import types
from collections.abc import Iterable, Mapping
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic.fields import FieldInfo

from lapwing.file_schemas.key_docs import REQUIRED, Key, description, is_table, keys

Schema = dict[str, Any]
PLAIN = {float: "number", int: "integer", str: "string", bool: "boolean", dict: "object"}
BOUNDS = {
    "ge": "minimum",
    "gt": "exclusiveMinimum",
    "le": "maximum",
    "lt": "exclusiveMaximum",
    "min_length": "minItems",
    "max_length": "maxItems",
    "pattern": "pattern",
}


def dereference(schema: Schema, node: Schema) -> Schema:
    """Return a node of a schema with its reference resolved, and its other keys."""
    while "$ref" in node:
        target: Any = schema
        for part in node["$ref"].removeprefix("#/").split("/"):
            target = target[part]
        node = {**target, **{key: value for key, value in node.items() if key != "$ref"}}
    return node


def table_schema(cls: type, leave_out: Iterable[str] = ()) -> Schema:
    """Return the schema of a table that a class declares, without some of its keys."""
    result = [key for key in keys(cls) if key.name not in leave_out]
    return {
        **closed_table({key.name: key_schema(key) for key in result}),
        **required_keys([key.name for key in result if key.default is REQUIRED]),
    }


def closed_table(properties: Mapping[str, Schema]) -> Schema:
    """Return the schema of a table with these keys and no others."""
    return {"type": "object", "properties": dict(properties), "additionalProperties": False}


def required_keys(names: list[str]) -> Schema:
    """Return the part of a table's schema with its required keys."""
    return {"required": names} if names else {}


def key_schema(key: Key) -> Schema:
    """Return the schema of a key with its description and default."""
    result = schema_of(key.hint)
    if text := description(key):
        result["description"] = text
    if (plain := _plain(key.default)) is not None:
        result["default"] = plain
    return result


def _plain(default: Any) -> Any:
    """Return a default as JSON value; None for a table, a non-finite number, or no default."""
    if default is REQUIRED or is_table(type(default)) or isinstance(default, dict):
        return None
    if isinstance(default, float) and not math.isfinite(default):
        return None
    return list(default) if isinstance(default, tuple) else default


def schema_of(hint: Any) -> Schema:
    """Return the schema of an annotation; None in a union marks an optional key."""
    origin, arguments = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return _add_bounds(schema_of(arguments[0]), arguments[1:])
    if origin in (Union, types.UnionType):
        members = [schema_of(member) for member in arguments if member is not type(None)]
        return members[0] if len(members) == 1 else {"anyOf": members}
    if origin is Literal:
        return {"enum": list(arguments)}
    if origin is dict:
        return _mapping(*arguments)
    if origin in (tuple, list):
        return _array(arguments, origin is list or arguments[-1] is Ellipsis)
    if isinstance(hint, type) and is_table(hint):
        return table_schema(hint)
    return {"type": PLAIN[hint]}


def _add_bounds(schema: Schema, metadata: Iterable[Any]) -> Schema:
    flat = [part for m in metadata for part in (m.metadata if isinstance(m, FieldInfo) else [m])]
    for part in flat:
        for attribute, word in BOUNDS.items():
            value = getattr(part, attribute, None)
            if value is not None:
                text = word.endswith("Items") and schema.get("type") == "string"
                schema[word.replace("Items", "Length") if text else word] = value
    return schema


def _mapping(name: Any, value: Any) -> Schema:
    if get_origin(name) is Literal:
        return closed_table({choice: schema_of(value) for choice in get_args(name)})
    return {"type": "object", "additionalProperties": schema_of(value)}


def _array(arguments: tuple, open_ended: bool) -> Schema:
    """Return the schema of a list of equal items, as tuples of tables are."""
    items = schema_of(arguments[0])
    if open_ended:
        return {"type": "array", "items": items}
    assert all(schema_of(other) == items for other in arguments), arguments
    return {"type": "array", "items": items, "minItems": len(arguments), "maxItems": len(arguments)}
