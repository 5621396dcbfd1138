"""Error in a configuration value: its key, the fault, and the expected values."""

import difflib
from collections.abc import Iterable


def did_you_mean(name: str, choices: Iterable[str]) -> str:
    """Return "; did you mean X?" for the choice nearest to an unknown name, "" if none is similar or begins with it."""
    listed = list(choices)
    near = difflib.get_close_matches(name, listed, n=1) or [c for c in listed if name[2:] and c.startswith(name)]
    return f"; did you mean {near[0]}?" if near else ""


class ConfigError(ValueError):
    """Invalid value of a key; `str` is one line."""

    def __init__(self, key: str, message: str, expected: str = ""):
        """Create the error.

        Args:
            key: dotted path of the key, "" for the whole configuration.
            message: description, for example "missing" or "got -1".
            expected: valid values, for example "a number above 0"; "" if the message is complete.
        """
        super().__init__(key, message, expected)
        self.key, self.message, self.expected = key, message, expected

    @classmethod
    def unknown(cls, key: str, what: str, name: object, choices: Iterable[str]) -> "ConfigError":
        """Return the error of an unknown name; it lists the choices, the nearest first."""
        listed = sorted(choices)
        return cls(
            key,
            f"unknown {what} {name!r}{did_you_mean(str(name), listed)}",
            f"one of {', '.join(listed)}" if listed else "none",
        )

    def with_prefix(self, prefix: str) -> "ConfigError":
        """Return the error with a key relative to the enclosing table."""
        return ConfigError(".".join(filter(None, (prefix, self.key))), self.message, self.expected)

    @property
    def sentence(self) -> str:
        """Description with the expected values."""
        if not self.expected:
            return self.message
        if self.message.startswith("got "):
            return f"expected {self.expected}, {self.message}"
        return f"{self.message}{'' if self.message.endswith('?') else ';'} expected {self.expected}"

    def __str__(self) -> str:
        return f"{self.key}: {self.sentence}" if self.key else self.sentence
