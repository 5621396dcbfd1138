"""Scene tables with one subtable per name: `[effects.NAME]`, `[sensors.NAME]`."""

from collections.abc import Mapping
from typing import Any

from pydantic import ConfigDict

from lapwing.cosim.scene import Files, Scene, SceneTable
from lapwing.dynamics.config_error import ConfigError
from lapwing.services.common import user_code, user_modules


class NamedTables(SceneTable):
    """Subtables by name; a user-defined entry has the key `module`."""

    model_config = ConfigDict(extra="allow", frozen=True, allow_inf_nan=False)

    @property
    def tables(self) -> Mapping[str, Any]:
        """Subtables of the scene by name, without those that `NAME = false` switches off."""
        return {name: table for name, table in self._entries.items() if table is not False}

    @property
    def switched_off(self) -> set[str]:
        """Names of the entries that are false."""
        return {name for name, table in self._entries.items() if table is False}

    @property
    def _entries(self) -> Mapping[str, Any]:
        return self.__pydantic_extra__ or {}

    @classmethod
    def embed(cls, tree: dict[str, Any], files: Files) -> None:
        """Store the user modules in the table `modules`."""
        entries = tree.get(cls.TABLE, {})
        for name, entry in entries.items() if isinstance(entries, dict) else ():
            if isinstance(entry, dict) and isinstance(module := entry.get("module"), str):
                user_modules.embed(tree, files, f"{cls.TABLE}.{name}.module", module)

    def check(self, scene: Scene) -> None:
        """Raise ConfigError unless every entry is a table."""
        for name, table in self.tables.items():
            if not isinstance(table, dict):
                raise ConfigError(f"{self.TABLE}.{name}", f"got {table!r}", "a table, {} for its defaults, or false")

    def load(self, scene: Scene) -> None:
        """Import the user modules. Raise ConfigError if one cannot be imported."""
        texts = user_modules.texts(scene)
        for name, table in self.tables.items():
            if "module" in table:
                key = f"{self.TABLE}.{name}.module"
                if not isinstance(table["module"], str):
                    raise ConfigError(key, f"got {table['module']!r}", "the name of a module")
                user_code.load_module(key, table["module"], texts)
