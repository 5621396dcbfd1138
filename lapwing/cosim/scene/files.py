"""Files of a scene: located by path or name, read once, and stored for the log."""

import tomllib
from collections.abc import Collection
from functools import lru_cache
from os.path import isfile  # returns False for invalid file names
from pathlib import Path
from typing import Any

from lapwing.cosim.scene.scene_error import KeyOrigin, SceneError
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.input_file import read_bytes


class Files:
    """Reader of the files of one scene."""

    def __init__(self, folder: Path, overridden: Collection[str] = ()):
        self.folder = folder  # folder of the scene; paths are relative to it
        self.overridden = overridden  # keys of overrides; their paths are relative to the working directory, too
        self.sources: dict[str, bytes] = {}  # contents of the files that were read, by file name: airframe.toml
        self.read_from: dict[str, Path] = {}  # file by the dotted key of its content in the scene
        self.texts: dict[str, str] = {}  # text of the file by the same key

    def path(self, key: str, name: str) -> Path:
        """Return the path of a name: relative to the scene; of an override, relative to the working directory first."""
        return Path(name).resolve() if self._is_overridden(key) and isfile(name) else self.folder / name

    def _is_overridden(self, key: str) -> bool:
        return any(f"{key}.".startswith(f"{overridden}.") for overridden in self.overridden)

    def find(self, key: str, kind: str, name: str, local_folder: str, shipped: Path) -> Path:
        """Return the TOML file that a key names: by path, or by name in the scene's folder or in the package.

        Args:
            key: dotted key whose value is the name.
            kind: kind of file, for the message.
            name: path that ends in .toml, see `path`; or a name.
            local_folder: name of a folder next to the scene.
            shipped: folder of the package.

        Raises:
            ConfigError: there is no such file; lists the choices.
        """
        if name.endswith(".toml"):
            if isfile(path := self.path(key, name)):
                return path
            either = " or the working directory" if self._is_overridden(key) else ""
            expected = f"the path of a .toml file relative to the scene{either}, or a name"
            raise ConfigError(key, f"no file {path}", expected)
        folders = (self.folder / local_folder, shipped)
        for folder in folders:
            if isfile(folder / f"{name}.toml"):
                return folder / f"{name}.toml"
        choices = {path.stem for folder in folders for path in folder.glob("*.toml")}
        error = ConfigError.unknown(key, kind, name, choices)
        raise ConfigError(key, error.message, f"{error.expected}, or the path of a .toml file")

    def text(self, key: str, named_by: str, path: Path) -> str:
        """Return the text of a file.

        Args:
            key: dotted key that its content will have in the scene.
            named_by: dotted key whose value names the file.
            path: path of the file.

        Raises:
            ConfigError: it cannot be read.
        """
        try:
            content = read_bytes(path)
            text = content.decode("utf-8")
        except OSError as error:
            raise ConfigError(named_by, f"{path}: {(error.strerror or 'cannot be read').lower()}") from None
        except UnicodeDecodeError:
            raise ConfigError(named_by, f"{path}: not a UTF-8 text file") from None
        self.sources[f"{key}{path.suffix}"] = content
        self.read_from[key], self.texts[key] = path, text
        return text

    def toml(self, key: str, named_by: str, path: Path) -> dict[str, Any]:
        """Return the tables of a TOML file. See `text` for arguments and errors; raise SceneError for invalid TOML."""
        return parse_toml(self.text(key, named_by, path), path)


def parse_toml(text: str, path: Path) -> dict[str, Any]:
    """Return the tables of a TOML text. Raise SceneError with the file for invalid TOML."""
    try:
        return deep_copy(_tables(text))
    except tomllib.TOMLDecodeError as error:
        raise SceneError("", f"not valid TOML: {error}", source=KeyOrigin(path)) from None
    except RecursionError:
        raise SceneError("", "not valid TOML: nested too deeply", source=KeyOrigin(path)) from None


@lru_cache(maxsize=64)
def _tables(text: str) -> dict[str, Any]:
    """Parse a TOML text, with a cache: the runs of a campaign have the same texts."""
    return tomllib.loads(text)


def deep_copy(value: Any) -> Any:
    """Return a deep copy of tables and lists, three times as fast as `copy.deepcopy`."""
    if isinstance(value, dict):
        return {key: deep_copy(item) for key, item in value.items()}
    return [deep_copy(item) for item in value] if isinstance(value, list) else value


def merge_tables(content: dict[str, Any], override: Any) -> Any:
    """Return the tables of a file with the keys of `override` replaced."""
    if not isinstance(override, dict):
        return override
    merged = dict(content)
    for key, value in override.items():
        file_value = content.get(key)
        merged[key] = (
            merge_tables(file_value, value) if isinstance(file_value, dict) and isinstance(value, dict) else value
        )
    return merged


def unvalidated_value(tree: dict[str, Any], table: str, key: str, default: Any = None) -> Any:
    """Return the value of a key in data that is not validated yet, or `default`; None without such a table."""
    result = tree.get(table)
    return result.get(key, default) if isinstance(result, dict) else None
