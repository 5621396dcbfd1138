"""Effects: one file for each, discovered in this folder.

The file `body_drag.py` defines the effect `body_drag`: a parameter NamedTuple `BodyDrag`, and hooks registered for it
(see `_hooks`). Its parameters are the keys of the scene's table, validated against the annotations, unless the class
has `from_scene(table, airframe)`. An effect that depends on the place of the flight has `in_environment(environment)`,
which returns its parameters there. Of the effects whose modules have the same constant `KIND` only one may be active;
a module's `check(table, tables)` rejects other combinations.

A user's effect is such a file on Python's path; the scene's table names it with `module`.
"""

import importlib
from collections.abc import Collection, Iterable, Mapping
from types import ModuleType
from typing import Any

from lapwing.dynamics import discovery
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.effects._from_scene import Airframe, validate_table
from lapwing.dynamics.environment import STANDARD, Environment

__all__ = ["from_scene", "get", "in_evaluation_order", "names", "options", "parameter_class", "validate_table"]

# Effects are evaluated in the order of these keys, by default their names. The order affects the rounding of sums, so a
# renamed effect keeps its key.
_ORDER = {
    "axial_inflow": "rotor_inflow",
    "coaxial_interference": "coaxial_wash",
    "dc_motor": "motor_electrics",
    "downwash": "rotor_wash",
    "dynamic_inflow": "induced_velocity",
    "payload_release": "payload",
    "random_wind_force": "wind_random",
    "shared_slung_load": "carried_load",
}


def names() -> list[str]:
    """Return the names of all effects: their file names."""
    return discovery.names(__name__)


def get(name: str, module: str | None = None) -> ModuleType:
    """Return the module of an effect. Raise ConfigError with the choices if there is none.

    Args:
        name: name of the effect.
        module: importable module of a user's effect.
    """
    if module is not None:
        if name in names():
            raise ConfigError(f"effects.{name}.module", f"{name} is the name of a shipped effect", "another name")
        return importlib.import_module(module)
    if name not in names():
        error = ConfigError.unknown(f"effects.{name}", "effect", name, names())
        expected = f'{error.expected}; an effect of your own needs `module = "FILE"` (lapwing new effect {name})'
        raise ConfigError(error.key, error.message, expected)
    return importlib.import_module(f"{__name__}.{name}")


def class_name(name: str) -> str:
    """Return the name of an effect's parameter class: "BodyDrag" for "body_drag"."""
    return "".join(word.capitalize() for word in name.split("_"))


def parameter_class(name: str, module: str | None = None) -> type:
    """Return the parameter class of an effect. See `get` for arguments."""
    defining, expected = get(name, module), class_name(name)
    if not hasattr(defining, expected):
        raise ConfigError(
            f"effects.{name}.module", f"{module} has no class {expected}", "a class with the effect's parameters"
        )
    return getattr(defining, expected)


def options(name: str, module: str | None = None) -> Mapping[str, Any]:
    """Return typical values of the keys of an effect that are models of their own. See `get` for arguments."""
    return getattr(get(name, module), "OPTIONS", {})


def in_evaluation_order(active: Iterable[str]) -> list[str]:
    """Return names of effects in the order of evaluation."""
    return sorted(active, key=lambda name: _ORDER.get(name, name))


def from_scene(
    tables: Mapping[str, Mapping],
    airframe: Airframe,
    environment: Environment = STANDARD,
    external: Collection[str] = (),
) -> tuple:
    """Return the active effects of a scene in the order of evaluation, from the table of each.

    Args:
        tables: tables of the effects by name.
        airframe: airframe of the vehicle.
        environment: air, gravity and ground.
        external: names of effects whose named inputs an external model computes (see `_external_inputs`).

    Raises:
        ConfigError: names the key `effects.<name>.<key>`: an unknown effect, a parameter that is missing, unknown, of
            the wrong type or out of range, an effect that the vehicle cannot have, or two that exclude each other.
    """
    active = []
    kinds: dict[str, str] = {}
    for name in in_evaluation_order(tables):
        table = dict(tables[name])
        module = table.pop("module", None)
        kind = getattr(get(name, module), "KIND", name)
        if kind in kinds:
            raise ConfigError(
                f"effects.{name}", f"cannot be combined with effects.{kinds[kind]}, also a {kind}; keep one of them"
            )
        kinds[kind] = name
        if hasattr(get(name, module), "check"):
            try:
                get(name, module).check(table, tables)
            except ConfigError as error:
                raise error.with_prefix(f"effects.{name}") from None
        cls = parameter_class(name, module)
        build = getattr(cls, "from_scene", None)
        try:
            effect = build(table, airframe) if build else validate_table(cls, table)
        except ConfigError as error:
            raise error.with_prefix(f"effects.{name}") from None
        effect = effect.in_environment(environment) if hasattr(effect, "in_environment") else effect
        active.append(effect.with_inputs() if name in external else effect)
    return tuple(active)
