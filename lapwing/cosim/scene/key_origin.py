"""Origin of a key in a scene: the line of a file, or an override."""

import re
from collections.abc import Iterable
from pathlib import Path

from lapwing.cosim.scene.files import Files
from lapwing.cosim.scene.scene_error import KeyOrigin


def source_of(key: str, path: Path, text: str, overrides: Iterable[str], files: Files) -> KeyOrigin:
    """Return the origin of a key: the file or override with the longest part of its path.

    Args:
        key: dotted key.
        path: file of the scene.
        text: text of the scene.
        overrides: overridden keys.
        files: files that the scene names.
    """
    overrides = list(overrides)
    file_keys = [k for k in files.read_from if f"{key}.".startswith(f"{k}.")]
    file_key = max(file_keys, key=len, default="")  # key of the file that contains this key
    parents = [k for k in overrides if f"{key}.".startswith(f"{k}.") and len(k) > len(file_key)]
    if parents:
        return KeyOrigin(override=max(parents, key=len))
    children = [k for k in overrides if k.startswith(f"{key}.")]
    if children:
        return KeyOrigin(override=children[0])
    line, matched = line_of(text, key)
    if file_key and matched <= len(file_key):
        file_line, _ = line_of(files.texts[file_key], key[len(file_key) + 1 :])
        return KeyOrigin(files.read_from[file_key], file_line)
    return KeyOrigin(path, line)


def line_of(text: str, key: str) -> tuple[int | None, int]:
    """Search a dotted key in TOML text, or the nearest table that contains it.

    Returns:
        The line number (None if there is none), and the length of the matching part of the key.
    """
    table = ""
    entries: dict[str, int] = {}  # index of the newest entry of each array of tables
    best, result = 0, None
    for number, line in enumerate(text.splitlines(), 1):
        if header := re.match(r"\s*(\[\[?)\s*([\w.]+)\s*\]", line):
            table = _numbered_name(header[2], entries, last=header[1] == "[")
            if header[1] == "[[":
                entries[table] = entries.get(table, -1) + 1
                table = f"{table}.{entries[table]}"
            full = table
        elif entry := re.match(r"\s*([\w.]+)\s*=", line):
            full = f"{table}.{entry[1]}" if table else entry[1]
        else:
            continue
        if f"{key}.".startswith(f"{full}.") and len(full) > best:
            best, result = len(full), number
    return result, best


def _numbered_name(table: str, entries: dict[str, int], last: bool) -> str:
    """Return a table's name with the number of the newest entry after each array of tables, the last if `last`."""
    *parents, name = table.split(".")
    full = ""
    for parent in parents:
        full = f"{full}.{parent}" if full else parent
        full = f"{full}.{entries[full]}" if full in entries else full
    full = f"{full}.{name}" if full else name
    return f"{full}.{entries[full]}" if last and full in entries else full
