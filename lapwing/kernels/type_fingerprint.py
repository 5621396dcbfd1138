"""Fingerprints of Python values: equal fingerprints mean equal numba types, and are found many times faster."""

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
