"""The files that a scene names: found by path or by name, read once, remembered for the log."""

import tomllib
from functools import lru_cache
from os.path import isfile  # false, and no error, of a name that no file can have
from pathlib import Path
from typing import Any

from lapwing.cosim.scene.scene_error import KeyOrigin, SceneError
from lapwing.dynamics.config_error import ConfigError


class Files:
    """Reads the files of one scene."""

    def __init__(self, folder: Path):
        self.folder = folder  # of the scene; paths are relative to it
        self.sources: dict[str, bytes] = {}  # every file that was read, by file name: airframe.toml
        self.read_from: dict[str, Path] = {}  # file by the dotted key that its content has in the scene
        self.texts: dict[str, str] = {}  # its text, by the same

    def find(self, key: str, what: str, name: str, beside: str, shipped: Path) -> Path:
        """Return the TOML file that a key names: by path, or by name in the scene's folder or in the package.

        Args:
            key: dotted key whose value is the name.
            what: what the name is of, for the message.
            name: a path that ends in .toml, relative to the scene; or a name.
            beside: name of a folder next to the scene.
            shipped: folder of the package.

        Raises:
            KeyedError: there is none; lists the choices.
        """
        if name.endswith(".toml"):
            if not isfile(self.folder / name):
                raise ConfigError(
                    key, f"no file {self.folder / name}", "the path of a .toml file relative to the scene, or a name"
                )
            return self.folder / name
        places = (self.folder / beside, shipped)
        for place in places:
            if isfile(place / f"{name}.toml"):
                return place / f"{name}.toml"
        choices = {path.stem for place in places for path in place.glob("*.toml")}
        error = ConfigError.unknown(key, what, name, choices)
        raise ConfigError(key, error.message, f"{error.expected}, or the path of a .toml file")

    def text(self, key: str, named_by: str, path: Path) -> str:
        """Return the text of a file.

        Args:
            key: dotted key that its content will have in the scene.
            named_by: dotted key whose value names the file.
            path: of the file.

        Raises:
            KeyedError: it cannot be read.
        """
        if path.exists() and not path.is_file() and not path.is_dir():
            raise ConfigError(named_by, f"{path}: is not a regular file")
        try:
            content = path.read_bytes()
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
        return copied(_tables(text))
    except tomllib.TOMLDecodeError as error:
        raise SceneError("", f"not valid TOML: {error}", source=KeyOrigin(path)) from None
    except RecursionError:
        raise SceneError("", "not valid TOML: nested too deeply", source=KeyOrigin(path)) from None


@lru_cache(maxsize=64)
def _tables(text: str) -> dict[str, Any]:
    """Parsed once: the runs of a campaign are made of the same texts."""
    return tomllib.loads(text)


def copied(value: Any) -> Any:
    """Return a deep copy of tables and lists, in a third of the time of `copy.deepcopy`."""
    if isinstance(value, dict):
        return {key: copied(item) for key, item in value.items()}
    return [copied(item) for item in value] if isinstance(value, list) else value


def merge_tables(content: dict[str, Any], given: Any) -> Any:
    """Merge the tables of a scene over those of a file, key by key."""
    if not isinstance(given, dict):
        return given
    merged = dict(content)
    for key, value in given.items():
        below = content.get(key)
        merged[key] = merge_tables(below, value) if isinstance(below, dict) and isinstance(value, dict) else value
    return merged


def named(tree: dict[str, Any], table: str, key: str, default: Any = None) -> Any:
    """Return the value of a key in data that is not validated yet; None without such a table."""
    result = tree.get(table)
    return result.get(key, default) if isinstance(result, dict) else None
