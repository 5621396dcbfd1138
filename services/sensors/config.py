"""The `[sensors]` of a scene: a table for each sensor that the vehicle carries."""

from collections.abc import Mapping
from typing import Any, ClassVar

from pydantic import ConfigDict

from services.scene import Scene, Section
from services.sections import Exchange, ticks


class Sensors(Section):
    """Sensors by name (imu, gps, ...): `preset`, parameters that differ from it, and `faults`."""

    TABLE: ClassVar[str] = "sensors"
    model_config = ConfigDict(extra="allow", frozen=True, allow_inf_nan=False)

    @property
    def tables(self) -> Mapping[str, Any]:
        """The table of each sensor that the scene names."""
        return self.__pydantic_extra__ or {}

    def lookup(self, keys: list[str]) -> Any:
        """A parameter of a sensor; "imu.rate" is that of its preset unless the scene says otherwise."""
        from services.sensors.registry import parameters

        name, key = keys
        return getattr(parameters(name, self.tables[name], 1.0), key)

    def check(self, scene: Scene) -> None:
        """Every sensor exists, its parameters are sound, and its rate divides the exchange rate."""
        from services.sensors.registry import parameters

        for name, table in self.tables.items():
            if not isinstance(table, dict):
                raise ValueError(f"{name}: expected a table [sensors.{name}], got {table!r}")
            try:
                rate = parameters(name, table, scene[Exchange].interval).rate
            except ValueError as error:
                unknown = str(error).startswith("sensor: ")
                raise ValueError(f"{name}{': ' if unknown else '.'}{str(error).removeprefix('sensor: ')}") from None
            ticks(scene, rate, f"{name}.rate")
