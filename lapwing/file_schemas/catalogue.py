"""What a scene may name: effects and sensors, as tables with keys, and the autopilot's parameters."""

import sys
from types import ModuleType

from lapwing.dynamics import effects
from lapwing.services.autopilot import gains
from lapwing.services.common import autopilot_parameters
from lapwing.services.common.autopilot_parameters import Parameter
from lapwing.services.scene_resolver import load
from lapwing.services.sensors.registry import sensors


def effect_tables() -> dict[str, tuple[type, type]]:
    """(parameter class, class whose fields are the keys of its table) of every effect, by name."""
    return {name: (cls := effects.parameter_class(name), _settings(cls)) for name in effects.names()}


def _settings(cls: type) -> type:
    """An effect that needs more than its table says has another class for that."""
    return sys.modules[cls.__module__].Settings if hasattr(cls, "from_scene") else cls


def sensor_tables() -> dict[str, tuple[ModuleType, type]]:
    """(module, parameter class) of every sensor, by name."""
    return {name: (module, type(next(iter(module.PRESETS.values())))) for name, module in sensors().items()}


def flight_parameters() -> tuple[list[Parameter], list[Parameter]]:
    """The autopilot's parameters: those that are the same with every gain set, and those that belong to one."""
    tables = [autopilot_parameters.table(load("hover", {"autopilot.gains": name})) for name in gains.names()]
    first, *others = tables
    fixed = [p for name, p in first.items() if all(table[name] == p for table in others)]
    return fixed, [p for p in first.values() if p not in fixed]
