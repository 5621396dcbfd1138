"""Conversion of a scene's table to the parameters of an effect."""

from collections.abc import Iterable, Mapping
from functools import cache
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar

from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.vehicles.propeller import hover_flow
from lapwing.kernels import math

if TYPE_CHECKING:
    from pydantic import TypeAdapter

    from lapwing.dynamics.vehicles.airframe import Airframe
    from lapwing.dynamics.vehicles.airframe_tables import Propeller
else:
    Airframe = Any  # services do not import pydantic

__all__ = ["Airframe", "check_beside", "pitch_and_flow", "reject", "validate_table"]

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
    from lapwing.dynamics.validation import validated

    return validated(_adapter(cls).validate_python, _tuples(table), cls)  # type: ignore[arg-type]


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


def pitch_and_flow(propeller: "Propeller") -> tuple[float, float]:
    """Return (blade pitch [m/rad], induced velocity in hover over the rotor speed [m/rad]); reject pitch <= flow."""
    pitch, flow = propeller.pitch / (2.0 * math.pi), hover_flow(propeller)
    if flow >= pitch:
        reject(f"the propeller's pitch must be above {2.0 * math.pi * flow:.3g} m for its static thrust")
    return pitch, flow


def check_beside(tables: Mapping[str, Any], needed: str, excluded: Iterable[str]) -> None:
    """Reject an effect without the effect that it needs, or together with one that it excludes."""
    if needed not in tables:
        reject(f"needs effects.{needed}, which the scene does not have")
    for name in excluded:
        if name in tables:
            reject(f"cannot be combined with effects.{name}; keep one of them")
