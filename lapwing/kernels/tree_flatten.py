"""Structures of Python values, and generated functions that flatten values of one structure.

Equal structures mean equal numba types, and are faster to compute. A generated function is ten times as fast as a
recursive walk: cells of a flight hold about two thousand numbers, in trees that a campaign creates for every run.
"""

from typing import Any

import numpy as np

from lapwing.kernels.codegen import compile_source

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


def leaves(value: Any) -> list[Any]:
    """Return all numbers, arrays and cells of a tree of tuples and NamedTuples, in order."""
    result: list[Any] = []
    _walk(value, result)
    return result


def _walk(value: Any, result: list[Any]) -> None:
    if not isinstance(value, tuple):
        result.append(value)
        return
    for item in value:
        if type(item) is float:
            result.append(item)
        else:
            _walk(item, result)


class Flattener:
    """Generated function that flattens values of one structure."""

    def __init__(self, example: Any):
        """Generate the function for the structure of an example, which `structure` must know."""
        self._flatten = _generate(example)
        tuples, parts = self._flatten(example)
        self._types = tuple(map(type, tuples)), tuple(map(type, parts))
        # types whose class does not determine their structure
        self._closer = [(k, structure(part)) for k, part in enumerate(parts) if type(part) not in _PLAIN]

    def leaves(self, value: Any) -> tuple[Any, ...] | None:
        """Return all numbers, arrays and cells in order; None for a value of another structure."""
        try:
            tuples, parts = self._flatten(value)
        except (TypeError, ValueError):  # tuples differ in number or length
            return None
        if (tuple(map(type, tuples)), tuple(map(type, parts))) != self._types:
            return None
        return parts if all(_is_of(parts[k], expected) for k, expected in self._closer) else None


def _is_of(value: Any, expected: Any) -> bool:
    try:
        return structure(value) == expected
    except UnknownError:
        return False


def _generate(example: Any) -> Any:
    """Return a function that unpacks values like the example: (value) -> (tuples, leaves)."""
    lines: list[str] = []
    tuples: list[str] = []
    parts: list[str] = []

    def walk(value: Any, name: str) -> None:
        if not isinstance(value, tuple):
            parts.append(name)
            return
        tuples.append(name)
        names = [f"v{len(lines)}_{k}" for k in range(len(value))]
        lines.append(f"[{', '.join(names)}] = {name}")
        for item, of in zip(value, names, strict=True):
            walk(item, of)

    walk(example, "value")
    outputs = [f"({''.join(f'{name}, ' for name in names)})" for names in (tuples, parts)]
    return compile_source("flatten(value)", {}, *lines, f"return {', '.join(outputs)}")
