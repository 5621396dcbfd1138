"""The `[sensors]` table of a scene, with a table for each sensor of the vehicle."""

from typing import Any, ClassVar

from lapwing.cosim.scene import Scene
from lapwing.dynamics.config_error import ConfigError
from lapwing.services.common.schemas.communication_schema import Communication, ticks
from lapwing.services.common.schemas.named_tables import NamedTables
from lapwing.services.sensors.registry import parameters


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
