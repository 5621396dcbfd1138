"""A fault in a value that has a name, as a value: which key, what is wrong, what would be right."""

import difflib
from collections.abc import Iterable


class ConfigError(ValueError):
    """What is wrong with a key; `str` is one line."""

    def __init__(self, key: str, message: str, expected: str = ""):
        """A fault.

        Args:
            key: dotted path of the key, "" for the whole.
            message: what is wrong, for example "missing" or "got -1".
            expected: what would be right, for example "a number above 0"; "" where the message says it all.
        """
        super().__init__(key, message, expected)
        self.key, self.message, self.expected = key, message, expected

    @classmethod
    def unknown(cls, key: str, what: str, name: object, choices: Iterable[str]) -> "ConfigError":
        """A name that is none of the choices: lists them, the nearest first."""
        listed = sorted(choices)
        near = difflib.get_close_matches(str(name), listed, n=1)
        hint = f"; did you mean {near[0]}?" if near else ""
        return cls(key, f"unknown {what} {name!r}{hint}", f"one of {', '.join(listed)}" if listed else "none")

    def with_prefix(self, prefix: str) -> "ConfigError":
        """The same fault, with the key seen from the table around it."""
        return ConfigError(".".join(filter(None, (prefix, self.key))), self.message, self.expected)

    @property
    def sentence(self) -> str:
        """What is wrong and what would be right."""
        if not self.expected:
            return self.message
        if self.message.startswith("got "):
            return f"expected {self.expected}, {self.message}"
        return f"{self.message}{'' if self.message.endswith('?') else ';'} expected {self.expected}"

    def __str__(self) -> str:
        return f"{self.key}: {self.sentence}" if self.key else self.sentence
