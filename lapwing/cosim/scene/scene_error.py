"""Error in a scene: the key, the fault, and the origin of the key."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from lapwing.dynamics.config_error import ConfigError


class KeyOrigin(NamedTuple):
    """Origin of a key's value: a line of a file, or an override."""

    path: Path | None = None
    line: int | None = None
    override: str | None = None  # its key, or its full text if it is not KEY=VALUE or has no effect
    option: str = "override"  # what names the override in messages, e.g. a command-line option

    def __str__(self) -> str:
        if self.override is not None:
            return f"{self.option} {self.override}"
        return f"{self.path or ''}{f':{self.line}' if self.line else ''}"


NOWHERE = KeyOrigin()


class SceneError(ConfigError):
    """Invalid scene; `str` is one line for the user."""

    __module__ = "lapwing"  # the name in tracebacks is that to catch

    def __init__(self, key: str, message: str, expected: str = "", source: KeyOrigin = NOWHERE):
        super().__init__(key, message, expected)
        self.args = (key, message, expected, source)
        self.source = source

    def with_option(self, option_of: Callable[[str], str]) -> "SceneError":
        """Return the error with the name of the option that gave the override; `option_of` returns "" for others."""
        if self.source.override is None or self.source.option != KeyOrigin().option:
            return self
        option = option_of(self.source.override.partition("=")[0].strip()) or self.source.option
        return SceneError(self.key, self.message, self.expected, self.source._replace(option=option))

    def __str__(self) -> str:
        override = self.source.override
        if override is not None and f"{self.key}.".startswith(f"{override}."):
            return f"{self.source.option} {self.key}: {self.sentence}"
        sentence = self.sentence if override and override.startswith(f"{self.key}=") else super().__str__()
        return ": ".join(filter(None, (str(self.source), sentence)))
