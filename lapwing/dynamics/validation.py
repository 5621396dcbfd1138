"""Base class of the tables of TOML files, and conversion of pydantic's validation errors into `ConfigError`."""

import types
from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from annotated_types import Ge, Gt, Le, Lt
from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic.fields import FieldInfo

from lapwing.dynamics import units
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.field_comments import comments, split

T = TypeVar("T")
BOUNDS = {Gt: ("gt", "above"), Ge: ("ge", "at least"), Lt: ("lt", "below"), Le: ("le", "at most")}
NAMES = {float: "a number", int: "a whole number", str: "a text", bool: "true or false", dict: "a table"}
UNKNOWN_KEY = ("extra_forbidden", "unexpected_keyword_argument")
OF_NUMBERS = ("float_type", "int_type", "int_from_float", "float_parsing", "int_parsing", *(
    "greater_than", "greater_than_equal", "less_than", "less_than_equal"))  # fmt: skip
LONGEST = 60  # shown characters of an invalid value


class Table(BaseModel):
    """Table of a TOML file: no unknown keys, finite numbers, and TOML's types (a text is no number, `true` is not 1).

    The comment behind a field has its unit and description (`lapwing.dynamics.field_comments`).
    """

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


def validated(validate: Callable[[Any], T], table: Any, model: type) -> T:
    """Return the validated table; a number may also be a text with a unit of its kind, for example "30 deg".

    An angle may also be in degrees, by a key with the ending "_deg": `heading_deg = 30` instead of `heading`.

    Args:
        validate: function of pydantic for the table.
        table: mapping or list of plain data, which is not changed.
        model: pydantic model or NamedTuple, whose comments state the units.

    Raises:
        ConfigError: a value is invalid; its key is relative to the table.
    """
    while True:
        try:
            return validate(table)
        except ValidationError as error:
            converted = table
            for each in error.errors():
                if each["type"] in UNKNOWN_KEY:
                    converted = _in_degrees(converted, each["loc"], model)
                elif each["type"] in OF_NUMBERS and isinstance(each["input"], str):
                    number = units.parse(each["input"], _unit(model, each["loc"]).strip(" []"))
                    converted = converted if number is None else _replaced(converted, each["loc"], number)
            if converted is table:
                raise fault(error, model) from None
            table = converted


def _in_degrees(value: Any, location: Sequence[str | int], model: Any) -> Any:
    """Return plain data with `heading = "30 deg"` for `heading_deg = 30` at a location; the data itself for other keys.

    Raises:
        ConfigError: both keys are given; its key is relative to the data.
    """
    first, *rest = location
    if rest:
        try:
            inner = value[first]
        except (KeyError, IndexError, TypeError):  # the name of a member of a union
            return value
        return _replaced(value, [first], _in_degrees(inner, rest, follow(model, [first])))
    base = str(first).removesuffix("_deg")
    if base == first or "deg" not in units.UNITS.get(_unit(model, [base]).strip(" []"), {}):
        return value
    if base in value:
        raise ConfigError(str(first), f"got {base} and {first}", "one of them")
    number = value[first]
    text = f"{number!r} deg" if type(number) in (int, float) else number
    return {**{key: item for key, item in value.items() if key != first}, base: text}


def _replaced(value: Any, location: Sequence[str | int], new: Any) -> Any:
    """Return plain data with another value at a location; the data itself if nothing changes: `validated` ends."""
    if not location:
        return new
    first, *rest = location
    in_list = isinstance(value, list | tuple) and isinstance(first, int) and first < len(value)
    if not in_list and not (isinstance(value, Mapping) and first in value):
        return value
    inner = _replaced(value[first], rest, new)
    if inner is value[first]:
        return value
    if in_list:
        return type(value)(inner if i == first else item for i, item in enumerate(value))
    return {**value, first: inner}


def fault(error: ValidationError, model: type) -> ConfigError:
    """Return the most informative of pydantic's errors.

    Args:
        error: error of validating a table as `model`.
        model: pydantic model or NamedTuple.

    Returns:
        The error, with a key relative to the table.
    """
    # a misspelt key also leaves another one missing: report the misspelling
    first: Any = min(error.errors(), key=lambda e: e["type"] not in UNKNOWN_KEY)
    kind, value, context = first["type"], first["input"], first.get("ctx", {})
    location = [part for part in first["loc"] if part != "[key]"]  # [key]: the key itself is invalid
    key = ".".join(map(str, location))
    if kind in UNKNOWN_KEY:
        return ConfigError.unknown(key, "key", location[-1], keys(follow(model, location[:-1])))
    hint = follow(model, location)
    if kind in ("missing", "missing_argument"):
        return ConfigError(key, "missing", describe(hint) + _unit(model, location))
    if kind == "value_error":
        cause = context["error"]
        return cause.with_prefix(key) if isinstance(cause, ConfigError) else ConfigError(key, str(cause))
    if kind == "tuple_type" and isinstance(value, Mapping) and describe(hint) == "a list of tables":
        return ConfigError(key, "got one table", "a list of tables, with [[ ]] around its name")
    unit = _unit(model, location) if kind in OF_NUMBERS else ""
    if isinstance(value, str) and units.NUMBER.match(value) and (known := units.UNITS.get(unit.strip(" []"))):
        unit += f", or a text with one of {', '.join(known)}"
    elif unit == " [rad]" and isinstance(value, float | int) and abs(value) > 2.0 * units.PI:
        unit += f", or {location[-1]}_deg"
    return ConfigError(key, f"got {_short(value)}", _expectation(kind, first["msg"], context, hint) + unit)


def _unit(model: type, location: Sequence[str | int]) -> str:
    """Return " [m/s]" for the unit in the comment of the key at a location; "" without one."""
    path = list(location)
    while path and isinstance(path[-1], int):  # the unit of a list applies to all its numbers
        path.pop()
    if not path:
        return ""
    for table in _members(follow(model, path[:-1])):
        if keys(table) and (unit := split(comments(table).get(str(path[-1]), ""))[0]):
            return f" [{unit}]"
    return ""


def _expectation(kind: str, message: str, context: dict[str, Any], hint: Any) -> str:
    if kind in OF_NUMBERS and hint is not None:
        return describe(hint)
    if kind == "tuple_type":
        return "a list"
    if kind == "too_short":
        return f"at least {context['min_length']} of them"
    if kind == "too_long":
        return f"at most {context['max_length']} of them"
    if kind == "string_pattern_mismatch":
        return f"a text of the form {context['pattern']}"
    if kind in ("string_type", "bool_type"):
        return NAMES[str if kind == "string_type" else bool]
    if keys(hint):
        return f"a table of {', '.join(keys(hint))}"
    return message.removeprefix("Input should be ").removeprefix("a valid ")


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 4]} ..."


def keys(hint: Any) -> list[str]:
    """Return the keys of the table of an annotation."""
    for member in _members(hint):
        if isinstance(member, type) and issubclass(member, BaseModel):
            return list(member.model_fields)
        if hasattr(member, "_fields"):
            return list(member._fields)
    return []


def follow(hint: Any, location: Sequence[str | int]) -> Any:
    """Return the annotation at a location within `hint`. Return None if there is none."""
    if not location:
        return hint
    part, *rest = location
    members = _members(hint)
    for member in members:
        inner = _inner(member, part)
        if inner is not None:
            return follow(inner, rest)
    return follow(hint, rest) if len(members) > 1 else None  # pydantic also names the member of a union


def _inner(hint: Any, part: str | int) -> Any:
    origin, arguments = get_origin(hint), get_args(hint)
    if isinstance(part, int):
        if origin is tuple and arguments and arguments[-1] is not Ellipsis:
            return arguments[part] if part < len(arguments) else None
        return arguments[0] if origin in (tuple, list) and arguments else None
    if origin is dict:
        return arguments[1]
    if isinstance(hint, type) and issubclass(hint, BaseModel):
        return _annotation(hint.model_fields.get(part))
    if hasattr(hint, "_fields"):
        return get_type_hints(hint, include_extras=True).get(part)
    return None


def _annotation(field: FieldInfo | None) -> Any:
    """Return a field's annotation with its bounds."""
    if field is None or not field.metadata:
        return field and field.annotation
    return Annotated[(field.annotation, *field.metadata)]  # type: ignore[return-value]


def _members(hint: Any) -> list[Any]:
    """Return the possible types: the members of a union, or the annotation itself, without bounds and None."""
    if get_origin(hint) is Annotated:
        return _members(get_args(hint)[0])
    if get_origin(hint) in (Union, types.UnionType):
        return [member for part in get_args(hint) if part is not type(None) for member in _members(part)]
    return [hint]


def describe(hint: Any) -> str:
    """Describe the values of an annotation, for example "a number above 0 and at most 1"."""
    bounds: list[str] = []
    if get_origin(hint) is Annotated:
        hint, *metadata = get_args(hint)
        flat = [part for m in metadata for part in (m.metadata if isinstance(m, FieldInfo) else [m])]
        bounds = [
            f"{word} {getattr(m, name):g}" for m in flat for kind, (name, word) in BOUNDS.items() if type(m) is kind
        ]
    if get_origin(hint) in (Union, types.UnionType):
        words = " or ".join(dict.fromkeys(describe(part) for part in get_args(hint) if part is not type(None)))
    else:
        words = _words(hint)
    return f"{words} {' and '.join(bounds)}" if bounds else words


def _words(hint: Any) -> str:
    origin, arguments = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return describe(hint)
    if origin is Literal:
        return " or ".join(map(repr, arguments))
    if origin in (tuple, list) and arguments:
        single = origin is list or arguments[-1] is Ellipsis
        tables = bool(keys(arguments[0]))
        if single:
            return "a list of tables" if tables else "a list"
        return f"{len(arguments)} numbers"
    if keys(hint):
        return "a table"
    return NAMES.get(hint, "a value")
