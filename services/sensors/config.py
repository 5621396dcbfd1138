"""The `[sensors]` of a scene: a table for each sensor that the vehicle carries."""

from collections.abc import Mapping
from typing import Any, ClassVar

from pydantic import ConfigDict

from cosim.scene import Files, Scene, Section
from dynamics.errors import KeyedError
from services.common import user_code
from services.common.sections import Exchange, ticks
from services.sensors.registry import parameters


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
        name, key = keys
        return getattr(parameters(name, self.tables[name], 1.0), key)

    @classmethod
    def embed(cls, tree: dict[str, Any], files: Files) -> None:
        """The modules of sensors of the user's own become part of the table `modules`."""
        user_code.embed_all(tree, files, cls.TABLE)

    def check(self, scene: Scene) -> None:
        """Every sensor exists, its parameters are sound, and its rate divides the exchange rate."""
        for name, table in self.tables.items():
            if not isinstance(table, dict):
                raise KeyedError(f"sensors.{name}", f"got {table!r}", f"a table [sensors.{name}]")
        for name, table in self.tables.items():
            if "module" in table and not name.isidentifier():
                raise KeyedError(f"sensors.{name}", f"got {name!r}", "a name that a topic can have: letters, digits, _")
        user_code.load_all(self.TABLE, self.tables, user_code.texts_of(scene))
        for name, table in self.tables.items():
            try:
                rate = parameters(name, table, scene[Exchange].interval).rate
            except KeyedError as error:
                raise error.under("sensors") from None
            ticks(scene, rate, f"sensors.{name}.rate")
