"""Tables of keys in Markdown."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from lapwing.docs.annotations import Schema, schema_of
from lapwing.docs.key_docs import REQUIRED, Key, is_table

KINDS = {"number": "number", "integer": "whole number", "string": "text", "boolean": "true or false", "object": "table"}


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)


def key_table(keys: Sequence[Key], values: Mapping[str, Any] | None = None, prefix: str = "") -> str:
    """The keys of a table: type, unit, range, default, meaning.

    Args:
        keys: of the table; those of tables within it are not told.
        values: of which each key's value is shown instead of a default, by the heading of the column.
        prefix: put before each key.
    """
    columns = list(values or {"default": None})
    rows = []
    for key in keys:
        schema = schema_of(key.hint)
        found = [getattr(v, key.name) for v in values.values()] if values else [key.default]
        shown = [code(value) for value in found]
        rows.append([f"`{prefix}{key.name}`", kind(schema), key.unit, limits(schema), *shown, key.meaning])
    return table(["key", "type", "unit", "range", *columns, "meaning"], rows)


def kind(schema: Schema) -> str:
    """What a value is, in words."""
    if "anyOf" in schema:
        return " or ".join(kind(member) for member in schema["anyOf"])
    if "enum" in schema:
        return ", ".join(f"`{choice}`" for choice in schema["enum"])
    if schema.get("type") == "array":
        items, n = schema["items"], schema.get("maxItems")
        several = f"({kind(items)})" if items.get("type") == "array" else f"{kind(items)}s"
        return f"{n} {several}" if n and n == schema.get("minItems") else f"list of {several}"
    entries = list(schema.get("properties", {}).values())
    if entries and all(entry == {"type": "number"} for entry in entries):
        return f"table of numbers: {', '.join(f'`{name}`' for name in schema['properties'])}"
    return KINDS[schema["type"]]


def limits(schema: Schema) -> str:
    """The range of a value, or of each of several."""
    if "anyOf" in schema:
        return limits(schema["anyOf"][0])
    found = []
    if schema.get("type") == "array":
        least, most = schema.get("minItems"), schema.get("maxItems")
        if least and least != most:
            found.append(f"at least {least}")
        found.append(limits(schema["items"]))
    for word, sign in (("exclusiveMinimum", ">"), ("minimum", ">="), ("exclusiveMaximum", "<"), ("maximum", "<=")):
        if word in schema:
            found.append(f"{sign} {number(schema[word])}")
    if "pattern" in schema:
        found.append(f"`{schema['pattern']}`")
    return ", ".join(filter(None, found))


def code(value: Any) -> str:
    """A value as TOML has it; empty for what is left out, or a table."""
    if value is REQUIRED:
        return "required"
    if value is None or value in ("", (), {}) or is_table(type(value)):
        return ""
    return f"`{toml(value)}`"


def toml(value: Any) -> str:
    """A value as TOML has it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, tuple | list):
        return f"[{', '.join(map(toml, value))}]"
    return number(value)


def number(value: float) -> str:
    """A number in at most six digits."""
    if math.isinf(value):
        return "inf"
    if isinstance(value, int):
        return str(value) if abs(value) < 10**9 else f"{value:.4g}"
    return f"{value:.6g}"
