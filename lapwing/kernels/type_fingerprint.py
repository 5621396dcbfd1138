"""What compiled code can tell of a Python value: its structure, found many times faster than numba finds its type.

Two values of one structure have one numba type, so that what is made for a type is looked up by the structure.
"""

from typing import Any

import numpy as np

_PLAIN = frozenset({float, bool, type(None), np.float64, np.float32, np.int64, np.int32, np.bool_})
LONG = 63  # bits; numba may take a longer whole number for another type


class UnknownError(TypeError):
    """A value of which only numba can tell the type."""


def structure(value: Any) -> Any:
    """The structure, which can be hashed, of a number, an array, a cell, or a tuple or NamedTuple of such.

    Raises:
        UnknownError: it is something else.
    """
    of = type(value)
    if of in _PLAIN:
        return of
    if isinstance(value, tuple):
        return of, *map(structure, value)
    if of is int and value.bit_length() <= LONG:
        return of
    if of is np.ndarray:
        flags = value.flags
        return of, value.dtype, value.ndim, flags.c_contiguous, flags.f_contiguous, flags.aligned, flags.writeable
    if hasattr(of, "_numba_box_"):  # a cell
        return of, value._numba_type_
    raise UnknownError(of.__name__)
