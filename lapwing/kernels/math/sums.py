"""Sums, and lengths of vectors of any number of coordinates, in place of `sum`, `math.hypot` and `math.dist`."""

from collections.abc import Iterable

from lapwing.kernels.compiler.decorators import python_function
from lapwing.kernels.math import roots
from lapwing.kernels.math._export import register_compiled

_hypot = python_function(roots.hypot)


def hypot(*coordinates: float) -> float:
    """Return the Euclidean length of a vector, without overflow; of two coordinates in compiled code.

    Each further coordinate adds one rounding.
    """
    length = 0.0
    for index, coordinate in enumerate(coordinates):
        length = _hypot(length, coordinate) if index else abs(float(coordinate))
    return length


register_compiled(hypot, roots.hypot)


def total(values: Iterable[float]) -> float:
    """Return the sum, added one after the other; not in compiled code.

    Python's `sum` of floats compensates rounding errors since version 3.12, so its bits depend on the version.
    """
    result = 0.0
    for value in values:
        result += value
    return result


def dist(p: Iterable[float], q: Iterable[float]) -> float:
    """Return the Euclidean distance of two points; not in compiled code."""
    return hypot(*(a - b for a, b in zip(p, q, strict=True)))
