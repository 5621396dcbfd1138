"""Which sensors there are, and their parameters from a scene's tables."""

import importlib
import pkgutil
from collections.abc import Mapping, Sequence
from functools import cache
from types import ModuleType
from typing import Any

from pydantic import TypeAdapter, ValidationError

import services.sensors
from services.sensors import schedule


@cache
def sensors() -> dict[str, ModuleType]:
    """Every sensor, by name: a module of this folder that has `PRESETS`."""
    names = sorted(module.name for module in pkgutil.iter_modules(services.sensors.__path__))
    modules = {n: importlib.import_module(f"services.sensors.{n}") for n in names if n not in ("service", "registry")}
    return {name: module for name, module in modules.items() if hasattr(module, "PRESETS")}


def parameters(sensor: str, table: Mapping[str, Any], tick: float) -> Any:
    """Parameters of a sensor.

    Args:
        sensor: name of the sensor.
        table: of the scene: `preset`, any parameters that differ from it, and `faults`, a list of tables.
        tick: length of a tick [s], for the fault schedule.

    Raises:
        ValueError: "key: what is wrong, what would be right".
    """
    module = _choice("sensor", sensor, sensors())
    values = dict(table)
    preset = _choice("preset", values.pop("preset", next(iter(module.PRESETS))), module.PRESETS)
    faults: Sequence[Mapping[str, Any]] = values.pop("faults", ())
    adapter = TypeAdapter(type(preset), config={"extra": "forbid", "allow_inf_nan": True})
    try:
        p = adapter.validate_python(_merged(preset, values))
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        raise ValueError(f"{key}: {_problem(first, preset)}") from None
    return p._replace(faults=schedule.compile_faults(faults, module.CHANNELS, tick))


def _choice(what: str, name: str, choices: Mapping[str, Any]) -> Any:
    if name not in choices:
        raise ValueError(f"{what}: unknown {what} {name!r}; expected one of {', '.join(choices)}")
    return choices[name]


def _merged(preset: Any, table: Mapping[str, Any]) -> dict[str, Any]:
    """The preset's values as nested dictionaries, replaced where the table says something else."""
    merged = dict(preset._asdict())
    for key, value in table.items():
        inner = merged.get(key)
        merged[key] = _merged(inner, value) if hasattr(inner, "_asdict") and isinstance(value, Mapping) else value
    return {k: _merged(v, {}) if hasattr(v, "_asdict") else v for k, v in merged.items()}


def _problem(error: Any, preset: Any) -> str:
    if error["type"] == "extra_forbidden":
        owner = preset
        for part in error["loc"][:-1]:
            owner = getattr(owner, part)
        return f"unknown key; expected one of {', '.join(f for f in owner._fields if f != 'faults')}"
    message = error["msg"].removeprefix("Input should be ").removeprefix("a valid ")
    return f"expected {message}, got {error['input']!r}"
