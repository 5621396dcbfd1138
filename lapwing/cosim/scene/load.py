"""Scene from a TOML file, its overrides and the files that it names, or from a recorded tree."""

import difflib
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from lapwing.cosim.scene import vehicle_scenes
from lapwing.cosim.scene.files import Files, deep_copy, parse_toml
from lapwing.cosim.scene.key_origin import line_of, source_of
from lapwing.cosim.scene.overrides import Override, Overrides, apply, is_below_file_name, parse_all
from lapwing.cosim.scene.scene import Scene, SceneTable, Vocabulary
from lapwing.cosim.scene.scene_error import KeyOrigin, SceneError
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.input_file import check_regular
from lapwing.dynamics.validation import validated

SCENES_HINT = "expected a scene file (.toml); `lapwing scenes` lists the shipped scenes"
SCENE_FILE = "scene.toml"  # the scene's own text among its sources


def load(scene: str | Path, overrides: Overrides, vocabulary: Vocabulary, shipped: Path) -> Scene:
    """Read a scene and all files that it names, apply overrides, and validate it.

    Args:
        scene: path of its TOML file, or name of a shipped scene.
        overrides: overrides of any key of the scene and of the files that it names.
        vocabulary: tables that a scene may have.
        shipped: folder of the shipped scenes.

    Raises:
        SceneError: names the key, the fault and the expected value.
    """
    path = _find(scene, shipped)
    return parse(path, _read(path), overrides, vocabulary)


def parse(path: Path, text: str, overrides: Overrides, vocabulary: Vocabulary) -> Scene:
    """Load a scene from text; `path` determines its name and the folder of its files. See `load` for errors."""
    return _parse(path, text, parse_all(overrides), vocabulary)


def with_overrides(scene: Scene, overrides: Overrides, vocabulary: Vocabulary) -> Scene:
    """Return a loaded scene with further overrides; the last one for a key applies. Its files are read again.

    Raises:
        SceneError: names the key, the fault and the expected value.
        ValueError: the scene was not read from a file.
    """
    if scene.file_overrides is None or SCENE_FILE not in scene.sources:
        raise ValueError(f"{scene.path}: was not read from a file; load it from a file to override keys")
    return _parse(
        scene.path, scene.sources[SCENE_FILE].decode(), [*scene.file_overrides, *parse_all(overrides)], vocabulary
    )


def _parse(path: Path, text: str, overrides: list[Override], vocabulary: Vocabulary) -> Scene:
    keys = [o.key for o in overrides]
    tree, files = parse_toml(text, path), Files(path.parent, keys)
    files.sources[SCENE_FILE] = text.encode()
    locate = partial(_locate, path=path, text=text, keys=keys, files=files)
    with Scene(path, {}, vocabulary, locate=locate).located():
        vehicles = vehicle_scenes.count(tree)
        if vehicles:
            members = [_member(path, text, tree, i, overrides, vocabulary) for i in range(vehicles)]
            common = vehicle_scenes.common_tables(members, vocabulary)
            sources = files.sources | {name: text for scene in members for name, text in scene.sources.items()}
            return Scene(path, common, vocabulary, sources, tuple(overrides), locate, members)
    return _scene(path, tree, overrides, vocabulary, files, locate)


def _locate(key: str, path: Path, text: str, keys: list[str], files: Files) -> tuple[str, KeyOrigin]:
    """Return the key and its origin."""
    return key, source_of(key, path, text, keys, files)


def _locate_own(key: str, vehicle: int, path: Path, text: str, keys: list[str], files: Files) -> tuple[str, KeyOrigin]:
    """Return the full key and origin of a key of one of several vehicles; it may be common to all."""
    full = vehicle_scenes.own_key(key, vehicle)
    has_own_value = line_of(text, full)[1] > len(f"{vehicle_scenes.VEHICLE}.{vehicle}.")
    if (
        has_own_value
        or key.partition(".")[0] == vehicle_scenes.VEHICLE
        or any(f"{full}.".startswith(f"{k}.") for k in keys)
    ):
        return _locate(full, path, text, keys, files)
    return _locate(key, path, text, keys, files)


def _member(
    path: Path, text: str, tree: dict[str, Any], i: int, overrides: list[Override], vocabulary: Vocabulary
) -> Scene:
    """Return the scene of vehicle i of several."""
    keys = [o.key for o in overrides]
    own_overrides = vehicle_scenes.overrides_of(overrides, i, vehicle_scenes.count(tree), vocabulary)
    files = Files(path.parent, [o.key for o in own_overrides])
    locate = partial(_locate_own, vehicle=i, path=path, text=text, keys=keys, files=files)
    scene = _scene(path, vehicle_scenes.member(tree, i, vocabulary), own_overrides, vocabulary, files, locate)
    name = scene.lookup(f"{vehicle_scenes.VEHICLE}.name")
    scene.sources = {f"{name}.{source}": content for source, content in files.sources.items()}
    return scene


def _scene(
    path: Path,
    tree: dict[str, Any],
    overrides: list[Override],
    vocabulary: Vocabulary,
    files: Files,
    locate: Callable[[str], tuple[str, KeyOrigin]],
) -> Scene:
    with Scene(path, {}, vocabulary, files.sources, tuple(overrides), locate).located():
        _resolve(tree, overrides, vocabulary, files)
        tables = _tables(tree, vocabulary)
        scene = Scene(path, tables, vocabulary, files.sources, tuple(overrides), locate)
        _check(scene, tables, vocabulary)
    return scene


def from_resolved(tree: Mapping[str, Any], vocabulary: Vocabulary, name: str) -> Scene:
    """Return the scene whose `resolved` is `tree`, without opening a file.

    Raises:
        SceneError: the scene is no longer valid.
    """
    with Scene(Path(name), {}, vocabulary).located():
        if isinstance(entries := tree.get(vehicle_scenes.VEHICLE), list):
            shared = {name: table for name, table in tree.items() if name != vehicle_scenes.VEHICLE}
            members = [from_resolved({**shared, **entry}, vocabulary, name) for entry in entries]
            return Scene(Path(name), vehicle_scenes.common_tables(members, vocabulary), vocabulary, vehicles=members)
        tables = _tables(tree, vocabulary)
        scene = Scene(Path(name), tables, vocabulary)
        _check(scene, tables, vocabulary)
    return scene


def _find(scene: str | Path, shipped: Path) -> Path:
    """Return the file of a scene. Raise SceneError with the nearest name if there is none."""
    path = Path(scene)
    if path.exists() or path.suffix or len(path.parts) > 1:
        return path
    if not (shipped / f"{path}.toml").is_file():
        choices = [p.stem for p in shipped.glob("*.toml")]
        error = ConfigError.unknown("", "scene", str(path), choices)
        own = path.with_suffix(".toml")
        message = f"unknown scene '{path}'; did you mean {own}?" if own.is_file() else error.message
        raise SceneError("", message, f"{error.expected}, or the path of a .toml file")
    return shipped / f"{path}.toml"


def _read(path: Path) -> str:
    try:
        check_regular(path)
        return path.read_text(encoding="utf-8")
    except IsADirectoryError:
        raise SceneError("", "is a folder", "a scene file (TOML)", KeyOrigin(path)) from None
    except UnicodeDecodeError as error:
        if error.object.startswith(b"\x89MCAP"):
            expected = "a scene file (TOML); `lapwing resimulate` repeats the flight of a log"
            raise SceneError("", "is a log (MCAP)", expected, KeyOrigin(path)) from None
        raise SceneError("", "not valid TOML: not a UTF-8 text file", source=KeyOrigin(path)) from None
    except OSError as error:
        similar = difflib.get_close_matches(path.name, [p.name for p in path.parent.glob("*.toml")], n=1)
        hint = f"did you mean {path.parent / similar[0]}?" if similar else SCENES_HINT
        message = (error.strerror or "cannot be read").lower()
        raise SceneError("", f"{message}; {hint}", source=KeyOrigin(path)) from None


def _resolve(tree: dict[str, Any], overrides: list[Override], vocabulary: Vocabulary, files: Files) -> None:
    """Apply the overrides that may name a file, embed the content of all files, and apply the other overrides."""
    file_tables = {name for name, section in vocabulary.sections.items() if section.FROM_FILE}
    file_overrides = []
    for override in overrides:
        if override.key.partition(".")[0] in file_tables or is_below_file_name(tree, override.key):
            file_overrides.append(override)
        else:
            apply(tree, override)
    for section in vocabulary.sections.values():
        section.embed(tree, files)
    for override in file_overrides:
        apply(tree, override)


def _tables(tree: Mapping[str, Any], vocabulary: Vocabulary) -> dict[type[SceneTable], SceneTable]:
    """Return the tables, each validated separately."""
    known = vocabulary.sections
    for name in tree:
        if name not in known:
            raise ConfigError.unknown(name, "table", name, known)
    tables: dict[type[SceneTable], SceneTable] = {}
    for name, section in known.items():
        if section.OPTIONAL and name not in tree:
            continue
        raw = tree.get(name, {})
        if not isinstance(raw, dict):
            raise ConfigError(name, f"got {raw!r}", f"a table [{name}]")
        try:
            tables[section] = validated(section.model_validate, deep_copy(raw), section)
        except ConfigError as error:
            raise error.with_prefix(name) from None
    return tables


def _check(scene: Scene, tables: Mapping[type[SceneTable], SceneTable], vocabulary: Vocabulary) -> None:
    for check in vocabulary.checks:
        check(scene)
    for table in tables.values():
        table.check(scene)
