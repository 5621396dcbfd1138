"""The `[sensors]` table of a scene with a table for each sensor, the sensors of this folder, and their parameters."""

import importlib
import math
import pkgutil
from collections.abc import Mapping, Sequence
from functools import cache
from types import ModuleType
from typing import Any, ClassVar

from pydantic import TypeAdapter

import lapwing.services.sensors
from lapwing.cosim.scene import Scene
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.validation import validated
from lapwing.services.common.schemas.communication_schema import Communication, ticks
from lapwing.services.common.schemas.named_tables import NamedTables
from lapwing.services.sensors import fault_schedule

NO_SENSORS = ("schema", "service")  # they import the sensors


@cache
def sensors() -> dict[str, ModuleType]:
    """Return all sensors by name: the modules of this folder with `PRESETS`."""
    names = sorted(module.name for module in pkgutil.iter_modules(lapwing.services.sensors.__path__))
    modules = {n: importlib.import_module(f"lapwing.services.sensors.{n}") for n in names if n not in NO_SENSORS}
    return {name: module for name, module in modules.items() if hasattr(module, "PRESETS")}


def module_of(sensor: str, table: Mapping[str, Any]) -> ModuleType:
    """Return the module of a sensor: from this folder, or the user's module named in its table.

    Raises:
        ConfigError: the module does not exist or is incomplete.
    """
    if "module" not in table:
        if sensor not in sensors():
            raise ConfigError.unknown(sensor, "sensor", sensor, sensors())
        return sensors()[sensor]
    if sensor in sensors():
        raise ConfigError(f"{sensor}.module", f"{sensor} is the name of a built-in sensor", "another name")
    result = importlib.import_module(table["module"])
    if missing := [name for name in ("PRESETS", "READING", "blank", "initial", "sample") if not hasattr(result, name)]:
        raise ConfigError(f"{sensor}.module", f"{table['module']} has no {', '.join(missing)}")
    return result


def parameters(sensor: str, table: Mapping[str, Any], tick: float) -> Any:
    """Return the parameters of a sensor.

    Args:
        sensor: name of the sensor.
        table: scene table: `preset`, parameters that differ from it, and `faults`, a list of tables.
        tick: length of a tick [s], for the fault schedule.

    Raises:
        ConfigError: a value is invalid; the key is relative to the sensors' tables.
    """
    module = module_of(sensor, table)
    values = dict(table)
    values.pop("module", None)
    name = values.pop("preset", next(iter(module.PRESETS)))
    if not isinstance(name, str) or name not in module.PRESETS:
        raise ConfigError.unknown(f"{sensor}.preset", "preset", name, module.PRESETS)
    preset = module.PRESETS[name]
    faults: Sequence[Mapping[str, Any]] = values.pop("faults", ())
    kind: Any = type(preset)
    try:
        p = validated(_adapter(kind).validate_python, _merge(preset, values), kind)
        _check_limits(p)
        if hasattr(module, "check"):
            module.check(p)
        if not hasattr(p, "faults"):
            if faults:
                raise ConfigError("faults", f"{sensor} has no fault model; remove them")
            return p
        return p._replace(faults=fault_schedule.compile_faults(faults, module.CHANNELS, tick))
    except ConfigError as error:
        raise error.with_prefix(sensor) from None


@cache
def _adapter(cls: Any) -> TypeAdapter:
    return TypeAdapter(cls, config={"extra": "forbid", "allow_inf_nan": True})


def _check_limits(p: Any) -> None:
    """Raise ConfigError if a range is empty, or a number other than a limit is infinite."""
    for key, value in p._asdict().items():
        if hasattr(value, "_asdict"):
            try:
                _check_limits(value)
            except ConfigError as error:
                raise error.with_prefix(key) from None
        elif value == math.inf and p._field_defaults.get(key) != math.inf:
            raise ConfigError(key, "got inf", "a finite number")
    least, most = getattr(p, "range_min", 0.0), getattr(p, "range_max", math.inf)
    if least >= most:
        raise ConfigError("range_min", f"got {least:g}", f"less than range_max = {most:g} m")


def _merge(preset: Any, table: Mapping[str, Any]) -> dict[str, Any]:
    """Return the preset's values as nested dictionaries, overridden by the table."""
    merged = dict(preset._asdict())
    for key, value in table.items():
        inner = merged.get(key)
        merged[key] = _merge(inner, value) if hasattr(inner, "_asdict") and isinstance(value, Mapping) else value
    return {k: _merge(v, {}) if hasattr(v, "_asdict") else v for k, v in merged.items()}


class Sensors(NamedTables):
    """Sensors by name (imu, gps, ...): `preset`, parameters that differ from it, and `faults`."""

    TABLE: ClassVar[str] = "sensors"

    def lookup(self, keys: list[str]) -> Any:
        """Return a parameter of a sensor, such as "imu.rate", from the scene or by default from its preset."""
        name, key = keys
        return getattr(parameters(name, self.tables[name], 1.0), key)

    def check(self, scene: Scene) -> None:
        """Check that every sensor exists, its parameters are valid, and its rate divides the communication rate."""
        super().check(scene)
        for name in self.switched_off - set(sensors()):
            raise ConfigError.unknown(f"{self.TABLE}.{name}", "sensor", name, sensors())
        for name, table in self.tables.items():
            if "module" in table and not name.isidentifier():
                raise ConfigError(f"sensors.{name}", f"got {name!r}", "a valid topic name: letters, digits, _")
        self.load(scene)
        for name, table in self.tables.items():
            try:
                rate = parameters(name, table, scene[Communication].interval).rate
            except ConfigError as error:
                raise error.with_prefix("sensors") from None
            ticks(scene, rate, f"sensors.{name}.rate")
