"""Description of an FMU and its connectable variables."""

import base64
import difflib
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from lapwing.dynamics.config_error import ConfigError
from lapwing.fmi.field_units import Unit, parse_unit
from lapwing.fmi.importer.archive import LARGEST, read_archive
from lapwing.fmi.importer.service_config import Element

INTEGERS = ("Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64")
TYPES = ("Real", "Float64", "Float32", "Integer", *INTEGERS, "Boolean", "Enumeration")
TEXTS = ("String", "Binary")  # types of start values, Binary in hexadecimal
LISTED = 10  # variables that a message names
_BASE = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")  # base units in FMI


class NamedUnit(NamedTuple):
    """A unit and its name."""

    name: str
    unit: Unit


class Description:
    """FMU that can run on this machine.

    Attributes:
        version: version of FMI, 2 or 3.
    """

    def __init__(self, key: str, path: Path, content: bytes):
        """Read the description.

        Args:
            key: key of the FMU in the scene.
            path: path of the FMU, for messages.
            content: content of the file.

        Raises:
            ConfigError: not an FMU, for another platform, not for co-simulation, or with unsupported clocks.
        """
        model, self.version = read_archive(key, path, content)
        if v := next((v for v in model.modelVariables if _must_tick(v)), None):
            message = f"{path}: input clock {v.name}, which the importer must activate in time, is not supported"
            raise ConfigError(key, message, "an FMU without clocks, or with triggered ones")
        self._units = {u.name: u.baseUnit for u in model.unitDefinitions or () if u.baseUnit is not None}
        self._variables = {v.name: v for v in model.modelVariables}
        # structural parameters, of FMI 3.0 only; in FMI 2.0 each type has references of its own
        self._lengths = {v.valueReference: v for v in model.modelVariables if v.causality == "structuralParameter"}

    def elements(self, key: str, name: str, causality: str) -> list[Element]:
        """Return the scalar of this name, the elements of the array, or the element NAME[i, j] of an array.

        Raises:
            ConfigError: no such variable, or it has another causality or type.
        """
        v, index = self._named(name)
        if v is None:
            fitting = self._listed(name, causality)
            raise ConfigError(key, f"unknown variable {name!r}", f"one of {fitting}" if fitting else "none")
        if causality and v.causality != causality:
            message = f"{name} has causality {v.causality}"
            fitting = self._listed(name, causality)
            raise ConfigError(key, message, f"an {causality} of the FMU{fitting and ': '}{fitting}")
        if v.type not in (TYPES if causality else TYPES + TEXTS):
            raise ConfigError(key, f"{name} has the type {v.type}", f"a variable of type {', '.join(TYPES)}")
        if v.clocks:
            clock = v.clocks[0].name
            raise ConfigError(key, f"{name} changes with the clock {clock}", "a variable without a clock")
        if v.causality == "structuralParameter":
            raise ConfigError(key, f"{name} is a structural parameter, which keeps its value", "another variable")
        shape = self._shape(v)
        size = math.prod(shape)
        if not index:
            if not shape:
                return [Element(name, v.valueReference, v.type, 0, 1)]
            return [Element(f"{name}[{i}]", v.valueReference, v.type, i, size) for i in range(size)]
        return [Element(name, v.valueReference, v.type, _position(key, name, index, shape), size)]

    def _named(self, name: str) -> tuple[Any, str]:
        """Return the variable of a name or of the name of an element, None if there is none, and the index."""
        if name in self._variables or not name.endswith("]"):
            return self._variables.get(name), ""
        head, _, index = name[:-1].rpartition("[")
        return self._variables.get(head), index

    def _listed(self, name: str, causality: str) -> str:
        """Return the names of the variables of a causality, or with a start value; the nearest to `name` first."""
        own = [
            n for n, v in self._variables.items() if (v.causality == causality if causality else v.start is not None)
        ]
        near = difflib.get_close_matches(name, own, LISTED, cutoff=0.5)
        names = [*near, *(n for n in own if n not in near)]
        more = f" and {len(names) - LISTED} more" if len(names) > LISTED else ""
        return ", ".join(names[:LISTED]) + more

    def _shape(self, v: Any) -> tuple[int, ...]:
        """Return the lengths of an array at the start values of the structural parameters; () for a scalar."""
        lengths = []
        for each in getattr(v, "dimensions", None) or ():
            fixed = getattr(each, "start", None)
            source = self._lengths.get(getattr(each, "valueReference", None))
            lengths.append(int(fixed if fixed is not None else source.start if source is not None else 0))
        return tuple(lengths)

    def unit(self, key: str, element: Element) -> NamedUnit | None:
        """Return the unit of a variable as the FMU defines it, None if it has none.

        Raises:
            ConfigError: the unit has no definition, or an offset.
        """
        v, _ = self._named(element.variable)
        name = v.unit or getattr(v.declaredType, "unit", None)
        if not name:
            return None
        base = self._units.get(name)
        if base is not None and base.offset:
            raise ConfigError(
                key, f"{v.name} is in {name}, a unit with an offset", "a unit without an offset, such as K"
            )
        if base is not None:
            powers = tuple((each, int(getattr(base, each))) for each in sorted(_BASE) if getattr(base, each))
            return NamedUnit(name, Unit(float(base.factor), powers))
        if (unit := parse_unit(name)) is None:
            raise ConfigError(key, f"{v.name} is in {name}, which the FMU does not define", "a unit with a definition")
        return NamedUnit(name, unit)


def _must_tick(v: Any) -> bool:
    """Return True for a clock whose tick times are defined by the FMU or its description."""
    return v.type == "Clock" and v.causality == "input" and v.intervalVariability != "triggered"


def _position(key: str, name: str, index: str, shape: tuple[int, ...]) -> int:
    try:
        indices = [int(part) for part in index.split(",")]
    except ValueError:
        indices = []
    if len(indices) != len(shape) or not all(0 <= i < n for i, n in zip(indices, shape, strict=False)):
        lengths = " x ".join(map(str, shape))
        raise ConfigError(key, f"{name}: no such element", f"indices from 0 of an array of {lengths or 'no'} elements")
    position = 0
    for i, n in zip(indices, shape, strict=True):
        position = position * n + i
    return position


def content_of(key: str, path: Path, embedded: str | None) -> bytes:
    """Return the content of an FMU, from its file unless it is embedded in base64.

    Raises:
        ConfigError: it cannot be read.
    """
    try:
        if not embedded and (size := path.stat().st_size) > LARGEST:
            raise ConfigError(key, f"{path}: has {size / 1e9:.3g} GB", f"at most {LARGEST / 1e9:g} GB")
        return base64.b64decode(embedded, validate=True) if embedded else path.read_bytes()
    except ConfigError:
        raise
    except ValueError:
        raise ConfigError(key, "the embedded FMU is damaged", "a complete log, or the scene") from None
    except OSError as error:
        raise ConfigError(key, f"{path}: {(error.strerror or 'cannot be read').lower()}", "an FMU") from None


def start_elements(elements: list[Element], key: str, value: Any) -> Mapping[Element, float | str]:
    """Return the start value of each element. Raise ConfigError if the number or the type of values differs."""
    values = list(value) if isinstance(value, (list, tuple)) else [value]
    if len(values) != len(elements):
        raise ConfigError(key, f"{len(values)} values for {len(elements)} elements", "a value for each element")
    kind = elements[0].type
    if kind not in TEXTS:
        if isinstance(value, str):
            raise ConfigError(key, f"got the text {value!r} for the type {kind}", "a number")
        return dict(zip(elements, map(float, values), strict=True))
    if not isinstance(value, str) or elements[0].size > 1:
        raise ConfigError(key, f"got {value!r} for the type {kind}", "a text for a scalar variable")
    if kind == "Binary" and not re.fullmatch(r"([0-9a-fA-F]{2})*", value):
        raise ConfigError(key, f"got {value!r} for the type Binary", "hexadecimal digits, two for each byte")
    return {elements[0]: value}
