"""Variables of an exported part: the columns of its ports, its parameters and its state."""

import struct
from math import isnan
from typing import Any, NamedTuple

from numba.core import types

from lapwing.cosim.diagram.tick_schedule import Port
from lapwing.dynamics.vehicles.propeller_failures import Failure
from lapwing.fmi.export.exported_part import BoundaryPort, ExportedPart
from lapwing.fmi.field_units import field_unit
from lapwing.kernels.row_packing import pack_row
from lapwing.services.common.ports import EFFECT

INPUT, OUTPUT, PARAMETER, STATE = "input", "output", "parameter", "local"
REAL, INTEGER, BOOLEAN = "real", "integer", "boolean"


class Variable(NamedTuple):
    """Number that users of the part may read or write."""

    name: str  # "truth.position_world[0]"
    causality: str  # INPUT, OUTPUT, PARAMETER or STATE
    type: str  # REAL, INTEGER or BOOLEAN
    unit: str  # "m/s"; "" without one
    start: float | None  # None for an output
    port: int  # index of an output port
    offset: int  # number of the input, column of the port, or offset in the image [bytes]


def variables_of(part: ExportedPart) -> list[Variable]:
    """Return all variables of a part, in the order of their value references from 1."""
    result: list[Variable] = []
    staged = 0
    for port in part.inputs:
        result += _modelled(port, _columns(port, INPUT, 0, staged))
        staged += len(pack_row(port.port.example))
    for k, port in enumerate(part.outputs):
        result += _modelled(port, _columns(port, OUTPUT, k, 0))
    for leaf in part.image.leaves:
        block, _, path = leaf.path.partition("|")
        kind, _, rest = path.partition(".")
        if kind not in ("parameters", "state") or leaf.kind != types.float64:
            continue  # whole numbers are sizes, counts and switches
        if leaf.owner is Failure:
            continue  # its time must lie within its tick
        (start,) = struct.unpack_from("<d", part.image.data, leaf.offset)
        unit = field_unit(leaf.owner, leaf.field)
        prefix, causality = ("parameters", PARAMETER) if kind == "parameters" else ("state", STATE)
        name = _indices(".".join(filter(None, (prefix, structured_name(block), rest))))
        result.append(Variable(name, causality, REAL, unit, start, 0, leaf.offset))
    return result


def column_names(port: Port) -> list[str]:
    """Return the names of the variables of a port, one for each column."""
    return [v.name for v in _columns(BoundaryPort(port, 0, 1, port.name), INPUT, 0, 0)]


def _modelled(port: BoundaryPort, columns: list[Variable]) -> list[Variable]:
    """Return the columns of a port without those that no effect of the scene models, such as the battery's temperature.

    Named inputs of effects are NaN until they are set, and an FMU may compute what no effect models.
    """
    if port.port.name.rpartition("/")[2].startswith(EFFECT) or port.ring != port.port.name:
        return columns
    return [v for v, x in zip(columns, pack_row(port.port.example), strict=True) if not isnan(x)]


def structured_name(name: str) -> str:
    """Return the name of a port or block in FMI's structured naming: "left/truth" becomes "left.truth"."""
    return name.replace("/", ".")


def _indices(name: str) -> str:
    """Return a name with the indices of nested tuples in one pair of brackets: "feet[0,2]"."""
    return name.replace("][", ",")


def _columns(port: BoundaryPort, causality: str, index: int, first: int) -> list[Variable]:
    result: list[Variable] = []
    row = pack_row(port.port.example)

    def walk(part: Any, name: str, owner: type | None, field: str) -> None:
        if isinstance(part, tuple):
            fields = getattr(part, "_fields", None)
            for i, item in enumerate(part):
                if fields:
                    walk(item, f"{name}.{fields[i]}", type(part), fields[i])
                else:
                    walk(item, f"{name}[{i}]", owner, field)
            return
        kind = BOOLEAN if isinstance(part, bool) else INTEGER if isinstance(part, int) else REAL
        start = float(row[len(result)]) if causality == INPUT else None
        unit = field_unit(owner, field) if kind == REAL else ""
        result.append(Variable(_indices(name), causality, kind, unit, start, index, first + len(result)))

    walk(port.port.example, structured_name(port.port.name), None, "")
    return result
