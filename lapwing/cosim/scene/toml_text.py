"""TOML text of values and tables."""

import json
import re
from collections.abc import Mapping
from typing import Any


def toml(value: Any) -> str:
    """Return a value as TOML on one line. Raise ValueError for other types."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_bare(key)} = {toml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(toml, value)) + "]"
    raise ValueError(f"{value!r}: not a TOML value; use numbers, texts, lists and tables")


def _bare(key: str) -> str:
    return key if re.fullmatch(r"[\w-]+", key, re.ASCII) else json.dumps(key)


def dump(tables: Mapping[str, Any], prefix: str = "") -> str:
    """Return nested tables as TOML: plain keys first, then a heading for each table, which begins with `prefix`."""
    plain = [f"{key} = {toml(value)}\n" for key, value in tables.items() if not isinstance(value, Mapping)]
    inner = [
        f"[{prefix}{name}]\n{dump(table, f'{prefix}{name}.')}"
        for name, table in tables.items()
        if isinstance(table, Mapping)
    ]
    return "\n".join(["".join(plain), *inner] if plain else inner)
