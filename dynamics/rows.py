"""Trees of numbers as rows of a float64 array: how compiled code hands NamedTuples to others.

A tree is a tuple or NamedTuple of floats, integers, booleans and further trees. Every number takes one column, in
order; booleans are 0 or 1, integers are exact up to 2^53. Functions are compiled from the type of the tree, so that a
row costs as much as the numbers that are used of it.
"""

# numba.core.types fills itself at import
# mypy: disable-error-code="attr-defined"

from collections.abc import Callable, Iterator
from itertools import islice
from typing import Any

import numba
import numpy as np
from numba.core import types
from numba.core.errors import TypingError

from dynamics.generate import define, implements


def width(tree: Any) -> int:
    """Columns that a tree takes."""
    return sum(map(width, tree)) if isinstance(tree, tuple) else 1


def to_row(tree: Any) -> np.ndarray:
    """The numbers of a tree, shape (width,)."""
    flat: list[float] = []

    def walk(part: Any) -> None:
        if isinstance(part, tuple):
            for item in part:
                walk(item)
        else:
            flat.append(float(part))

    walk(tree)
    return np.array(flat)


def reader(like: Any) -> Callable[[np.ndarray], Any]:
    """A function from a row (width,) to the tree of the shape and types of `like` whose numbers stand in it."""
    result, names = construction(numba.typeof(like), lambda column: f"numbers[{column}]")
    read = define("read(numbers)", names, f"return {result}")
    return lambda row: read(row.tolist())


def columns(like: Any, rows: np.ndarray) -> Any:
    """The tree of columns of `rows` (n, width): a number becomes (n,), a flat tuple of numbers (n, k)."""
    return _columns(like, rows, iter(range(rows.shape[1])))


def _columns(part: Any, rows: np.ndarray, left: Iterator[int]) -> Any:
    """Those of a part of the tree from the next column on; no inner function, whose cycle would keep the rows."""
    if not isinstance(part, tuple):
        return rows[:, next(left)]
    if not any(isinstance(item, tuple) for item in part) and (not hasattr(part, "_fields") or _alike(part)):
        taken = list(islice(left, len(part)))
        return rows[:, taken[0] : taken[0] + len(taken)] if taken else rows[:, :0]
    items = [_columns(item, rows, left) for item in part]
    return type(part)(*items) if hasattr(part, "_fields") else tuple(items)


def _alike(part: tuple) -> bool:
    """Whether a NamedTuple stands for one quantity, such as a quaternion."""
    return type(part).__name__ == "Quaternion"


def _kind(tree: types.Type) -> str:
    if isinstance(tree, types.Boolean):
        return "{} != 0.0"
    if isinstance(tree, types.Integer):
        return "int({})"
    if isinstance(tree, types.Float):
        return "{}"
    raise TypingError(f"a row holds numbers, tuples and NamedTuples only, not {tree}")


def construction(tree: types.Type, number: Callable[[int], str]) -> tuple[str, dict[str, Any]]:
    """Source text that makes a tree of this type from its numbers, and the classes that it names.

    Args:
        tree: of tuples, NamedTuples and numbers.
        number: the source text of the number of a column.

    Raises:
        TypingError: something else is in it.
    """
    names: dict[str, Any] = {}
    column = 0

    def expression(part: types.Type) -> str:
        nonlocal column
        if not isinstance(part, types.BaseTuple):
            column += 1
            return _kind(part).format(number(column - 1))
        items = [expression(item) for item in part.types]
        if isinstance(part, types.BaseNamedTuple):
            name = f"Node{len(names)}"
            names[name] = part.instance_class
            return f"{name}({', '.join(items)})"
        return f"({', '.join(items)}{',' if len(items) == 1 else ''})"

    return expression(tree), names


def leaves(tree: types.Type, path: str) -> list[str]:
    """Source text of each number of a tree of this type, which is at `path`, in the order of its columns.

    Raises:
        TypingError: something else than tuples, NamedTuples and numbers is in it.
    """
    if isinstance(tree, types.BaseTuple):
        return [leaf for k, item in enumerate(tree.types) for leaf in leaves(item, f"{path}[{k}]")]
    _kind(tree)
    return [path]


def load(like: Any, rows: np.ndarray, i: int) -> Any:
    """The tree of the type of `like` in row i."""
    raise NotImplementedError("compiled code only")


@implements(load, inline=True)
def _load(like: types.Type, rows: types.Type, i: types.Type) -> Callable:
    result, names = construction(like, lambda column: f"rows[i, {column}]")
    return define("load(like, rows, i)", names, f"return {result}")


def store(tree: Any, rows: np.ndarray, i: int) -> None:
    """Put a tree into row i."""
    raise NotImplementedError("compiled code only")


@implements(store, inline=True)
def _store(tree: types.Type, rows: types.Type, i: types.Type) -> Callable:
    lines = [f"rows[i, {k}] = {path}" for k, path in enumerate(leaves(tree, "tree"))]
    return define("store(tree, rows, i)", {}, *lines, "return None")
