"""Keys of a table: types, bounds, defaults and comments from the class that declares it."""

import inspect
import re
from typing import Annotated, Any, NamedTuple, get_args, get_type_hints

from pydantic import BaseModel
from pydantic_core import PydanticUndefined

from lapwing.dynamics.field_comments import comments, split

REQUIRED = object()


class Key(NamedTuple):
    """A key of a table."""

    name: str
    hint: Any  # annotation with its bounds
    default: Any  # REQUIRED without a default
    unit: str  # "m/s"; "s, m" for several values; empty for texts and ratios
    meaning: str


def keys(cls: type) -> list[Key]:
    """Return the keys of a table, a pydantic model or NamedTuple, in their order."""
    comments_by_key = {name: split(comment) for name, comment in comments(cls).items()}
    return [
        Key(name, hint, default, *comments_by_key.get(name, ("", _purpose(hint))))
        for name, hint, default in _fields(cls)
    ]


def description(key: Key) -> str:
    """Return unit and meaning of a key."""
    return " ".join(filter(None, (f"[{key.unit}]" if key.unit else "", key.meaning)))


def _purpose(hint: Any) -> str:
    """Return the description of a table from the docstring of its class."""
    members = [member for member in get_args(hint) or (hint,) if isinstance(member, type) and member is not type(None)]
    return first_sentence(members[0]) if members and is_table(members[0]) else ""


def is_table(cls: type) -> bool:
    """Return True if a class declares a table: a pydantic model or a NamedTuple."""
    return issubclass(cls, BaseModel) or hasattr(cls, "_fields")


def first_sentence(thing: Any) -> str:
    """Return the first sentence of a docstring on one line, without its full stop."""
    text = " ".join((inspect.getdoc(thing) or "").split())
    return re.split(r"(?<!eq)(?<!e\.g)\.(?:\s|$)", text)[0]


def _fields(cls: type) -> list[tuple[str, Any, Any]]:
    if issubclass(cls, BaseModel):
        return [
            (
                name,
                Annotated[(field.annotation, *field.metadata)] if field.metadata else field.annotation,
                default(field),
            )
            for name, field in cls.model_fields.items()
        ]
    hints = get_type_hints(cls, include_extras=True)
    defaults = cls._field_defaults  # type: ignore[attr-defined]
    return [(name, hints[name], defaults.get(name, REQUIRED)) for name in cls._fields]  # type: ignore[attr-defined]


def default(field: Any) -> Any:
    """Return the default of a field of a pydantic model, REQUIRED if it has none."""
    if field.default_factory is not None:
        return field.default_factory()
    return REQUIRED if field.default is PydanticUndefined else field.default
