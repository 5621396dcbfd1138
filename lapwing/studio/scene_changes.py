"""Changes of a scene in the form: overrides, and the equivalent command line and Python code."""

import re
import tomllib
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from lapwing.studies.toml_text import toml
from lapwing.studio.form_fields import Field

SPEEDS = ("1", "2", "5", "10", "max")  # selectable values of --speed


class Change(NamedTuple):
    """A key with its new value."""

    key: str
    value: Any

    @property
    def override(self) -> str:
        """Override KEY=VALUE, as for --set."""
        text = toml(self.value)
        if (
            isinstance(self.value, str)
            and re.fullmatch(r"[A-Za-z_][\w./:+-]*", self.value)
            and not _is_word(text[1:-1])
        ):
            text = self.value  # a bare word is a text
        return f"{self.key}={text}"


def changes(
    fields: Iterable[Field], posted: Mapping[str, str], added: Iterable[str]
) -> tuple[list[Change], dict[str, str]]:
    """Return the changes of a posted form, and the faults by key.

    Args:
        fields: fields of the form.
        posted: posted texts by key.
        added: keys of added tables.
    """
    result = [Change(key, {}) for key in added]
    faults: dict[str, str] = {}
    for field in fields:
        text = posted.get(field.key, field.text).strip()
        if text in (field.text, ""):
            continue
        try:
            result.append(Change(field.key, _value(field, text)))
        except ValueError as error:
            faults[field.key] = str(error)
    return result, faults


def command_line(scene: str, changed: Iterable[Change], speed: str, view: bool) -> list[str]:
    """Return the words of the command that runs a scene with these changes."""
    words = ["lapwing", "run", scene]
    for change in changed:
        words += ["--set", change.override]
    return [*words, *(["--speed", speed] if speed else []), *(["--view"] if view else [])]


def python(scene: str, changed: Iterable[Change]) -> str:
    """Return Python code that runs a scene with these changes."""
    lines = [f"    {change.key!r}: {change.value!r},\n" for change in changed]
    overrides = ", {\n" + "".join(lines) + "}" if lines else ""
    return f"import lapwing\n\nflight = lapwing.fly({scene!r}{overrides})\nprint(flight.outcome)\nflight.report()\n"


def _value(field: Field, text: str) -> Any:
    """Return the value of a text in the form. Raise ValueError if it does not fit the field's kind."""
    if field.kind == "text" or (field.kind == "choice" and not _is_word(text)):
        return text
    try:
        (value,) = tomllib.loads(f"value = {text}").values()
    except (ValueError, RecursionError):  # invalid TOML, or more than one value
        expected = {"number": "a number", "integer": "a whole number"}.get(field.kind, "a TOML value, e.g. [1.0, 2.0]")
        raise ValueError(f"got {text[:60]}; expected {expected}") from None
    if field.kind == "integer" and type(value) is not int:
        raise ValueError(f"got {text[:60]}; expected a whole number")
    if field.kind == "number":
        if type(value) not in (int, float):
            raise ValueError(f"got {text[:60]}; expected a number")
        value = float(value)
    return value


def _is_word(text: str) -> bool:
    """Return True if a bare word is a TOML value other than a text."""
    return text in ("true", "false", "inf", "nan")
