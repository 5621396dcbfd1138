"""From a scene's table to an effect's parameters."""

from collections.abc import Mapping
from dataclasses import astuple
from functools import cache
from typing import Annotated, Any, NoReturn, TypeVar, get_args, get_origin, get_type_hints

from annotated_types import Ge, Gt, Le, Lt
from pydantic import ConfigDict, TypeAdapter, ValidationError

from dynamics.vehicles.airframe import one_line

T = TypeVar("T")
BOUNDS = {Gt: "above", Ge: "at least", Lt: "below", Le: "at most"}


@cache
def _adapter(cls: type) -> TypeAdapter:
    return TypeAdapter(cls, config=ConfigDict(strict=True, allow_inf_nan=False))


def checked(cls: type[T], table: Mapping[str, Any]) -> T:
    """The NamedTuple `cls` with the keys of a table.

    Raises:
        ValueError: one line that begins with `.key` if a key is missing, unknown, of the wrong type or out of range; it
            ends with the key's range if that has bounds.
    """
    try:
        return _adapter(cls).validate_python(_tuples(table))  # type: ignore[arg-type]
    except ValidationError as error:
        line = one_line(error, "", getattr(cls, "_fields", ()))
        key = error.errors()[0]["loc"][:1]
        bounds = _bounds(get_type_hints(cls, include_extras=True).get(str(*key)))
        raise ValueError(f"{line} (range: {bounds})" if bounds else line) from None


def _bounds(hint: Any) -> str:
    """The range that an annotation gives, for example "above 0, at most 1"; "" if it gives none."""
    if get_origin(hint) is Annotated:
        given = [f"{BOUNDS[type(m)]} {astuple(m)[0]:g}" for m in get_args(hint)[1:] if type(m) in BOUNDS]
        return ", ".join(given)
    return next((bounds for part in get_args(hint) if (bounds := _bounds(part))), "")


def _tuples(value: Any) -> Any:
    """TOML's lists as tuples."""
    if isinstance(value, Mapping):
        return {key: _tuples(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return tuple(_tuples(item) for item in value)
    return value


def cannot(reason: str) -> NoReturn:
    """Refuse an effect that the vehicle cannot have."""
    raise ValueError(f": {reason}")
