"""Fingerprints of Python values: equal fingerprints mean equal numba types, and are faster to compute."""

from typing import Any

import numpy as np

_PLAIN = frozenset({float, bool, type(None), np.float64, np.float32, np.int64, np.int32, np.bool_})
LONG = 63  # [bits] numba may give longer integers another type


class UnknownError(TypeError):
    """Error for a value whose type only numba can determine."""


def structure(value: Any) -> Any:
    """Return the hashable structure of a number, an array, a cell, or a tuple or NamedTuple of these.

    Raises:
        UnknownError: the value has another type.
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
