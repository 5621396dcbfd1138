"""Conversion of a scene's table to the parameters of an effect."""

from collections.abc import Iterable, Mapping
from functools import cache
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar

from lapwing.dynamics.config_error import ConfigError

if TYPE_CHECKING:  # services do not import pydantic
    from pydantic import TypeAdapter

T = TypeVar("T")


@cache
def _adapter(cls: type) -> "TypeAdapter":
    from pydantic import ConfigDict, TypeAdapter

    return TypeAdapter(cls, config=ConfigDict(strict=True, allow_inf_nan=False))


def validate_table(cls: type[T], table: Mapping[str, Any]) -> T:
    """Return the NamedTuple `cls` with the keys of a table.

    Raises:
        ConfigError: a key is missing, unknown, of the wrong type or out of range.
    """
    from pydantic import ValidationError

    from lapwing.dynamics.validation import fault

    try:
        return _adapter(cls).validate_python(_tuples(table))  # type: ignore[arg-type]
    except ValidationError as error:
        raise fault(error, cls) from None


def _tuples(value: Any) -> Any:
    """Convert TOML's lists to tuples."""
    if isinstance(value, Mapping):
        return {key: _tuples(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return tuple(_tuples(item) for item in value)
    return value


def reject(reason: str) -> NoReturn:
    """Reject an effect that the vehicle cannot have."""
    raise ConfigError("", reason)


def check_beside(tables: Mapping[str, Any], needed: str, excluded: Iterable[str]) -> None:
    """Reject an effect without the effect that it needs, or together with one that it excludes."""
    if needed not in tables:
        reject(f"needs effects.{needed}, which the scene does not have")
    for name in excluded:
        if name in tables:
            reject(f"cannot be combined with effects.{name}; keep one of them")
