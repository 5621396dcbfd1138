"""TOML text of nested tables of numbers, strings and lists."""

import json
from collections.abc import Mapping
from typing import Any


def dump(tables: Mapping[str, Any]) -> str:
    """Return TOML with plain keys first and a heading for each table."""
    plain = [f"{key} = {_value(value)}" for key, value in tables.items() if not isinstance(value, Mapping)]
    parts = ["\n".join(plain)] if plain else []
    parts += _sections("", tables)
    return "\n\n".join(parts) + "\n"


def _sections(prefix: str, tables: Mapping[str, Any]) -> list[str]:
    out = []
    for name, table in tables.items():
        if isinstance(table, Mapping):
            lines = [f"[{prefix}{name}]"]
            lines += [f"{key} = {_value(value)}" for key, value in table.items() if not isinstance(value, Mapping)]
            out.append("\n".join(lines))
            out += _sections(f"{prefix}{name}.", table)
    return out


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value)
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_value, value))}]"
    return repr(value)
