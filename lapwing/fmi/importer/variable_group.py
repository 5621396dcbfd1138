"""Variables of an FMU that one call sets or reads. Used in the process of the FMU."""

import ctypes
import math
from typing import Any, NamedTuple


class _Type(NamedTuple):
    suffix: str  # suffix of the set and get functions
    c_type: Any
    lowest: float  # range of integer types; 0 and 0 for other types
    highest: float


def _integer(suffix: str, c_type: Any, signed: bool = True) -> _Type:
    bits = 8 * ctypes.sizeof(c_type)
    limits = (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if signed else (0, 2**bits - 1)
    return _Type(suffix, c_type, *limits)


_FMI2 = {
    "Real": _Type("Real", ctypes.c_double, 0, 0),
    "Integer": _integer("Integer", ctypes.c_int),
    "Enumeration": _integer("Integer", ctypes.c_int),
    "Boolean": _Type("Boolean", ctypes.c_int, 0, 0),
}
_FMI3 = {
    "Float64": _Type("Float64", ctypes.c_double, 0, 0),
    "Float32": _Type("Float32", ctypes.c_float, 0, 0),
    **{f"Int{n}": _integer(f"Int{n}", getattr(ctypes, f"c_int{n}")) for n in (8, 16, 32, 64)},
    **{f"UInt{n}": _integer(f"UInt{n}", getattr(ctypes, f"c_uint{n}"), signed=False) for n in (8, 16, 32, 64)},
    "Enumeration": _integer("Int64", ctypes.c_int64),
    "Boolean": _Type("Boolean", ctypes.c_bool, 0, 0),
}


class Group:
    """Variables of one type, set or read by one call."""

    def __init__(self, instance: Any, verb: str, kind: str, elements: list[tuple[int, list[Any]]], numbers: Any):
        """Lay out the values of all elements of the variables.

        Args:
            instance: `CoSimulation` of the FMU.
            verb: "Set" or "Get".
            kind: type of the variables.
            elements: (index in `numbers`, `Element`).
            numbers: array of doubles that the variables are set from or read to.
        """
        spec = (_FMI3 if instance.is_3 else _FMI2)[kind]
        begins: dict[int, int] = {}
        names: dict[int, str] = {}
        total = 0
        for _, (name, reference, _, _, size) in elements:
            if reference not in begins:
                begins[reference], names[reference] = total, name
                total += size
        self.indices = [index for index, _ in elements]
        self.places = [begins[reference] + index for _, (_, reference, _, index, _) in elements]
        self.names = [element[0] for _, element in elements]
        self.partial = len(set(self.places)) < total
        self._numbers = numbers
        # contiguous doubles are passed to the FMU without a copy, other contiguous numbers by one slice
        begin = self.indices[0]
        is_dense = self.places == [*range(total)] and self.indices == [*range(begin, begin + total)]
        self._slice = slice(begin, begin + total) if is_dense else None
        self.in_place = is_dense and spec.c_type is ctypes.c_double
        values = spec.c_type * total
        self.values = values.from_buffer(numbers, begin * ctypes.sizeof(ctypes.c_double)) if self.in_place else values()
        self._former: list[float] = []  # the numbers that `values` has
        self._is_real = kind in ("Real", "Float64", "Float32")
        self._is_boolean = kind == "Boolean"
        self._limits = spec.lowest, spec.highest
        self.references = (ctypes.c_uint32 * len(begins))(*begins)
        sizes = (ctypes.c_size_t(total),) if instance.is_3 else ()
        self.arguments = (instance.component, self.references, ctypes.c_size_t(len(begins)), self.values, *sizes)
        self.function = instance.function(verb + spec.suffix)
        self._read = instance.function("Get" + spec.suffix)

    def fill(self) -> int:
        """Read all elements, for arrays that are only partly set. Return the status."""
        return int(self._read(*self.arguments))

    def set(self) -> int:
        """Set the variables to the numbers. Return the status.

        Raises:
            ValueError: a number does not fit the type.
        """
        self.convert()
        return int(self.function(*self.arguments))

    def get(self) -> int:
        """Read the numbers from the variables. Return the status."""
        status = int(self.function(*self.arguments))
        self.copy_out()
        return status

    def convert(self) -> None:
        """Convert the numbers to the values that are set. Raise ValueError if one does not fit the type."""
        if self.in_place:
            return
        numbers = self._numbers[self._slice or slice(None)]
        if numbers != self._former:
            self._convert()
            self._former = numbers

    def copy_out(self) -> None:
        """Copy the values that were read to the numbers."""
        if self.in_place:
            return
        if self._slice:
            self._numbers[self._slice] = self.values[:]
        else:
            for index, place in zip(self.indices, self.places, strict=True):
                self._numbers[index] = self.values[place]

    def _convert(self) -> None:
        for index, place, name in zip(self.indices, self.places, self.names, strict=True):
            value = self._numbers[index]
            if self._is_real:
                self.values[place] = value
            elif self._is_boolean:
                self.values[place] = value != 0.0
            elif math.isfinite(value) and self._limits[0] <= int(value) <= self._limits[1]:
                self.values[place] = int(value)
            else:
                raise ValueError(f"{name} cannot be set to {value:g}; its type has whole numbers in {self._limits}")
