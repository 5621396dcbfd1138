"""The `[services.NAME]` tables of a scene: FMUs that compute columns of ports."""

import base64
from typing import Any, ClassVar

from pydantic import Field, ValidationError

from lapwing.cosim.scene import Files, Scene
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.validation import Table
from lapwing.services.common.schemas.named_tables import NamedTables


class FmuTable(Table):
    """Table `[services.NAME]` of an FMU."""

    fmu: str  # path of the FMU, relative to the scene
    embed: bool = False  # store the FMU in the run configuration, and therefore in the log
    content: str | None = None  # the embedded FMU in base64; written by `embed`
    inputs: dict[str, str] = Field(default_factory=dict)  # FMU variable = "PORT.COLUMN", or "NAME.VARIABLE" of an FMU
    outputs: dict[str, str] = Field(default_factory=dict)  # "PORT.COLUMN" = FMU variable
    start: dict[str, float | str | list[float]] = Field(default_factory=dict)  # start values of FMU variables
    delay: int = Field(default=0, ge=0, le=1)  # [ticks] delay of the inputs; 1 if the FMU closes an algebraic loop
    timeout: float = Field(default=10.0, gt=0.0)  # [s] limit of the wall time of a step


class Services(NamedTables):
    """FMUs by name."""

    TABLE: ClassVar[str] = "services"
    OPTIONAL: ClassVar[bool] = True

    @classmethod
    def embed(cls, tree: dict[str, Any], files: Files) -> None:
        """Make the paths of FMUs absolute, so that a log can be resimulated from another folder, or embed them."""
        entries = tree.get(cls.TABLE, {})
        for name, entry in entries.items() if isinstance(entries, dict) else ():
            if isinstance(entry, dict) and isinstance(path := entry.get("fmu"), str):
                absolute = files.path(f"{cls.TABLE}.{name}.fmu", path).resolve()
                entry["fmu"] = str(absolute)
                # a missing file is reported when the scene is resolved
                if entry.get("embed") is True and absolute.is_file():
                    entry["content"] = base64.b64encode(absolute.read_bytes()).decode()

    def check(self, scene: Scene) -> None:
        """Raise ConfigError unless every entry is a table of an FMU."""
        for name in self.tables:
            self.fmu(name)

    def fmu(self, name: str) -> FmuTable:
        """Return the table of one FMU. Raise ConfigError if it is invalid."""
        key = f"{self.TABLE}.{name}"
        if not isinstance(table := self.tables[name], dict):
            raise ConfigError(key, f"got {table!r}", f"a table [{key}]")
        if not name.isidentifier():
            raise ConfigError(key, f"got the name {name!r}", "letters, digits and underscores")
        try:
            return FmuTable.model_validate(table)
        except ValidationError as error:
            first = error.errors()[0]
            where = ".".join(map(str, (key, *first["loc"])))
            raise ConfigError(where, first["msg"].lower(), f"keys {', '.join(FmuTable.model_fields)}") from None
