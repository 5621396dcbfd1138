"""Connections of an FMU's variables to the columns of ports, and to the outputs of other FMUs."""

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from lapwing.cosim.diagram.tick_schedule import Port
from lapwing.dynamics.config_error import ConfigError
from lapwing.fmi.field_units import field_unit, parse_unit
from lapwing.fmi.importer.description import Description, NamedUnit, content_of, start_elements
from lapwing.fmi.importer.schema import FmuTable
from lapwing.fmi.importer.service_config import Connection, Element, FmuConfig, StartValue, own_port
from lapwing.kernels import math
from lapwing.kernels.row_packing import pack_row
from lapwing.services.common.ports import EFFECT


class ImportedFmu:
    """FMU with its table in the scene.

    Attributes:
        exported: variables that other FMUs read, in the columns of `own_port`.
    """

    def __init__(self, name: str, table: FmuTable):
        """Read the description. Raise ConfigError if the FMU cannot run here."""
        self.name, self.table, self.key = name, table, f"services.{name}"
        self.path = Path(table.fmu)
        self.content = content_of(f"{self.key}.fmu", self.path, table.content)
        self.description = Description(f"{self.key}.fmu", self.path, self.content)
        self.exported: list[Element] = []

    def export(self, key: str, variable: str) -> tuple[list[int], list[NamedUnit | None]]:
        """Return the columns of the FMU's own port with a variable that another FMU reads, and their units."""
        columns = []
        for element in self.description.elements(key, variable, "output"):
            if element not in self.exported:
                self.exported.append(element)
            columns.append(self.exported.index(element))
        return columns, [self.description.unit(key, self.exported[k]) for k in columns]

    def config(
        self, ports: Mapping[str, Port], fmus: Mapping[str, "ImportedFmu"], effects: Mapping[str, Port]
    ) -> FmuConfig:
        """Connect all variables except exported ones, which `with_exports` adds.

        Args:
            ports: ports of the other services.
            fmus: all FMUs by name.
            effects: ports of named inputs of effects.

        Raises:
            ConfigError: a connection is invalid.
        """
        table, inputs, outputs, start = self.table, [], [], []
        for variable, source in table.inputs.items():
            key = f"{self.key}.inputs.{variable}"
            place = _columns_of_fmu(key, source, self.name, fmus) or _modelled(
                key, source, _columns(key, source, ports), ports
            )
            inputs += self._connections(key, variable, "input", source, place)
        for column, variable in table.outputs.items():
            key = f'{self.key}.outputs."{column}"'
            outputs += self._connections(key, variable, "output", column, _columns(key, column, {**ports, **effects}))
        for variable, value in table.start.items():
            key = f"{self.key}.start.{variable}"
            elements = self.description.elements(key, variable, "")
            start += [StartValue(*each) for each in start_elements(elements, key, value).items()]
        return FmuConfig(
            self.name, str(self.path), hashlib.sha256(self.content).hexdigest(), table.content or "",
            self.description.version, tuple(inputs), tuple(outputs), tuple(start), table.delay, table.timeout,
        )  # fmt: skip

    def with_exports(self, config: FmuConfig) -> FmuConfig:
        """Return the configuration with the outputs that other FMUs read."""
        own = [Connection(own_port(self.name), k, element, 1.0) for k, element in enumerate(self.exported)]
        return config._replace(inputs=_by_type(config.inputs), outputs=_by_type((*config.outputs, *own)))

    def _connections(self, key: str, variable: str, causality: str, name: str, place: "_Place") -> list[Connection]:
        elements = self.description.elements(key, variable, causality)
        if len(elements) != len(place.columns):
            number = f"{variable} has {len(elements)} elements, but {name} has {len(place.columns)}"
            raise ConfigError(key, number, "as many columns as elements")
        result = []
        for element, column, unit in zip(elements, place.columns, place.units, strict=True):
            factor = _factor(key, variable, self.description.unit(key, element), name, unit)
            factor = factor if causality == "input" else 1.0 / factor
            result.append(Connection(place.port, column, element, factor))
        return result


def _by_type(connections: tuple[Connection, ...]) -> tuple[Connection, ...]:
    """Return connections grouped by type, so that one call moves a group without copies."""
    return tuple(sorted(connections, key=lambda each: each.element.type))


class _Place(NamedTuple):
    """Columns of a port."""

    port: str
    columns: list[int]
    units: list[NamedUnit | None]


def _columns_of_fmu(key: str, source: str, name: str, fmus: Mapping[str, ImportedFmu]) -> _Place | None:
    """Return the columns of another FMU's outputs, "NAME.VARIABLE"; None if `source` names no FMU."""
    other, _, variable = source.partition(".")
    if other not in fmus:
        return None
    if other == name:
        raise ConfigError(key, f"{source} is an output of the FMU itself", "a port or another FMU")
    columns, units = fmus[other].export(key, variable)
    return _Place(own_port(other), columns, units)


def _columns(key: str, name: str, ports: Mapping[str, Port]) -> _Place:
    """Return the columns of "PORT.COLUMN", or of all columns below it, named as by `lapwing protocol`."""
    prefix = EFFECT if name.startswith(EFFECT) else ""
    port_name, _, path = name.removeprefix(prefix).partition(".")
    port_name = prefix + port_name
    if port_name not in ports:
        raise ConfigError.unknown(key, "port", port_name, ports)
    leaves: dict[str, NamedUnit | None] = {}

    def walk(part: Any, at: str, owner: type | None, field: str) -> None:
        if not isinstance(part, tuple):
            leaves[at] = _unit(owner, field)
            return
        fields = getattr(part, "_fields", None)
        for i, item in enumerate(part):
            step = fields[i] if fields else str(i)
            walk(item, f"{at}.{step}" if at else step, type(part) if fields else owner, step if fields else field)

    walk(ports[port_name].example, "", None, "")
    places = {leaf: k for k, leaf in enumerate(leaves)}
    below = [leaf for leaf in leaves if leaf == path or leaf.startswith(f"{path}.") or not path]
    if not below:
        raise ConfigError.unknown(key, "column", name, [f"{port_name}.{leaf}" for leaf in leaves])
    return _Place(port_name, [places[leaf] for leaf in below], [leaves[leaf] for leaf in below])


def _modelled(key: str, name: str, place: _Place, ports: Mapping[str, Port]) -> _Place:
    """Return a place. Raise ConfigError if no effect of the scene models one of its columns, which are NaN."""
    row = pack_row(ports[place.port].example)
    if any(math.isnan(row[k]) for k in place.columns):
        raise ConfigError(key, f"no effect of the scene models {name}", "another column, or an effect such as battery")
    return place


def _unit(owner: type | None, field: str) -> NamedUnit | None:
    name = field_unit(owner, field) if owner else ""
    unit = parse_unit(name) if name else None
    return NamedUnit(name, unit) if unit else None


def _factor(key: str, variable: str, theirs: NamedUnit | None, column: str, ours: NamedUnit | None) -> float:
    """Return the factor from the unit of a column to that of a variable.

    Raises:
        ConfigError: the units belong to different quantities.
    """
    if ours is None or theirs is None:
        return 1.0
    if ours.unit.powers != theirs.unit.powers:
        message = f"{variable} is in {theirs.name}, but {column} is in {ours.name}"
        raise ConfigError(key, message, "variables of the same quantity")
    return ours.unit.factor / theirs.unit.factor
