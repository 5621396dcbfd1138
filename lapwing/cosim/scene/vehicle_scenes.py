"""Scenes of several vehicles: each entry of `[[vehicle]]` is a scene of the shared tables and those of the entry.

The keys of an entry's table override those of the shared table. Keys of an entry that are not tables belong to
`[vehicle]`: `airframe = "quad_x"` names a file, `[vehicle.airframe.mass]` overrides its values.
"""

from collections.abc import Iterable, Mapping
from typing import Any

from lapwing.cosim.scene.files import deep_copy, merge_tables
from lapwing.cosim.scene.overrides import Override
from lapwing.cosim.scene.scene import Scene, SceneTable, Vocabulary
from lapwing.cosim.scene.scene_error import KeyOrigin, SceneError
from lapwing.dynamics.config_error import ConfigError

VEHICLE = "vehicle"
MAX_VEHICLES = 50


def count(tree: Mapping[str, Any]) -> int:
    """Return the number of vehicles that a scene lists; 0 if it has a table `[vehicle]`, or none.

    Raises:
        ConfigError: too many vehicles, or an entry is not a table.
    """
    entries = tree.get(VEHICLE)
    if not isinstance(entries, list):
        return 0
    if not 1 <= len(entries) <= MAX_VEHICLES:
        raise ConfigError(VEHICLE, f"{len(entries)} vehicles", f"1 to {MAX_VEHICLES}")
    for i, entry in enumerate(entries):
        if not isinstance(entry, dict):
            raise ConfigError(f"{VEHICLE}.{i}", f"got {entry!r}", f"a table [[{VEHICLE}]]")
    return len(entries)


def member(tree: Mapping[str, Any], i: int, vocabulary: Vocabulary) -> dict[str, Any]:
    """Return the tables of vehicle i, as in a scene of that vehicle alone, not yet validated.

    Raises:
        ConfigError: the entry has a table that all vehicles share.
    """
    common = {name: table for name, table in tree.items() if name != VEHICLE}
    own: dict[str, Any] = {VEHICLE: {}}
    for name, value in tree[VEHICLE][i].items():
        if isinstance(value, dict) and name in vocabulary.sections:
            _check_own(name, f"{VEHICLE}.{i}.{name}", vocabulary)
            own[name] = value
        else:
            own[VEHICLE][name] = value
    defaults = {name: keys for name, section in vocabulary.sections.items() if (keys := section.defaults_of(i))}
    return deep_copy(merge_tables(defaults, merge_tables(common, own)))


def overrides_of(overrides: Iterable[Override], i: int, vehicles: int, vocabulary: Vocabulary) -> list[Override]:
    """Return the overrides of vehicle i: its own, with the keys of a scene of that vehicle alone, and the common ones.

    Raises:
        SceneError: a key of `vehicle` without the vehicle's number, or of a table that all vehicles share.
    """
    result = []
    for override in overrides:
        table, *rest = override.key.split(".")
        if table != VEHICLE:
            result.append(override)
            continue
        if len(rest) < 2 or not rest[0].isdigit() or int(rest[0]) >= vehicles:
            known = {*vocabulary.sections, *vocabulary.sections[VEHICLE].model_fields}
            has_number = len(rest) > 1 and rest[0] not in known
            expected = f"{VEHICLE}.N.{'.'.join(rest[has_number:]) or 'KEY'}, N from 0 to {vehicles - 1}"
            raise SceneError(override.key, "no such vehicle", expected, KeyOrigin(override=override.text))
        name, *inner = rest[1:]
        if int(rest[0]) == i:
            if inner and name in vocabulary.sections:
                _check_own(name, override.key, vocabulary)
            key = ".".join([name, *inner] if inner else [VEHICLE, name])
            result.append(override._replace(key=key))
    return result


def own_key(key: str, i: int) -> str:
    """Return the full key for a key in the scene of vehicle i alone."""
    return f"{VEHICLE}.{i}.{key.removeprefix(f'{VEHICLE}.')}"


def common_tables(members: Iterable[Scene], vocabulary: Vocabulary) -> dict[Any, Any]:
    """Return the tables that all vehicles share.

    Raises:
        ConfigError: two vehicles have the same name, or the same value of another distinct key.
    """
    members = list(members)
    for section in vocabulary.sections.values():
        if section.DISTINCT:
            _check_distinct([scene[section].lookup([section.DISTINCT]) for scene in members], section)
    result = {}
    for section in vocabulary.sections.values():
        if section.SHARED and (tables := [scene[section] for scene in members if scene.has(section)]):
            merged: dict[str, Any] = {}  # files may be known to some of the scenes only
            for table in tables:
                merged = merge_tables(merged, table.resolved())
            result[section] = section.model_validate(merged) if tables.count(tables[0]) < len(tables) else tables[0]
    return result


def _check_own(table: str, key: str, vocabulary: Vocabulary) -> None:
    if vocabulary.sections[table].SHARED:
        raise ConfigError(key, "all vehicles share this table", f"a table [{table}] of the scene")


def _check_distinct(values: list[Any], section: type[SceneTable]) -> None:
    for i, value in enumerate(values):
        if value in values[:i]:
            table = "" if section.TABLE == VEHICLE else f"{section.TABLE}."
            message = f"{value} is already used by {VEHICLE}.{values.index(value)}"
            raise ConfigError(f"{VEHICLE}.{i}.{table}{section.DISTINCT}", message, "another value")
