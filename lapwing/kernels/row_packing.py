"""Trees of numbers packed into rows of a float64 array, the form in which compiled code exchanges NamedTuples.

A tree is a tuple or NamedTuple of floats, integers, booleans and further trees. Every number takes one column, in
order; booleans are 0 or 1, integers are exact up to 2^53. Arrays take no column: all rows share them. Functions are
generated from the type of the tree, so that reading a row costs only the numbers that the caller uses.
"""

# numba.core.types fills itself at import
# mypy: disable-error-code="attr-defined"

import itertools
from collections.abc import Callable, Iterator, Sequence
from itertools import islice
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.core.errors import TypingError
from numba.extending import intrinsic

from lapwing.kernels.codegen import compile_source


def row_width(tree: Any) -> int:
    """Return the number of columns of a tree."""
    if isinstance(tree, tuple):
        return sum(map(row_width, tree))
    return 0 if isinstance(tree, np.ndarray) else 1


def pack_row(tree: Any) -> np.ndarray:
    """Return the numbers of a tree as an array of shape (width,)."""
    flat: list[float] = []

    def walk(part: Any) -> None:
        if isinstance(part, tuple):
            for item in part:
                walk(item)
        elif not isinstance(part, np.ndarray):
            flat.append(float(part))

    walk(tree)
    return np.array(flat)


def row_unpacker(like: Any) -> Callable[[np.ndarray], Any]:
    """Return a function that unpacks a row (width,) into a tree with the shape and types of `like`."""
    result, names = construction(numba.typeof(like), lambda column: f"numbers[{column}]")
    read = compile_source("read(numbers)", names, f"return {result}")
    return lambda row: read(row.tolist())


def columns(like: Any, rows: np.ndarray) -> Any:
    """Return the tree of columns of `rows` (n, width): a number becomes (n,), a flat tuple of k numbers (n, k)."""
    return _columns(like, rows, iter(range(rows.shape[1])))


def _columns(part: Any, rows: np.ndarray, left: Iterator[int]) -> Any:
    """Return the columns of `rows` for this part of the tree, starting at the next one.

    Not an inner function, because its reference cycle would keep the rows alive.
    """
    if not isinstance(part, tuple):
        return rows[:, next(left)]
    if not any(isinstance(item, tuple) for item in part) and (not hasattr(part, "_fields") or _alike(part)):
        columns = list(islice(left, len(part)))
        return rows[:, columns[0] : columns[0] + len(columns)] if columns else rows[:, :0]
    items = [_columns(item, rows, left) for item in part]
    return type(part)(*items) if hasattr(part, "_fields") else tuple(items)


def _alike(part: tuple) -> bool:
    """Return True if a NamedTuple is one quantity, such as a quaternion."""
    return type(part).__name__ == "Quaternion"


def _kind(tree: types.Type) -> str:
    if isinstance(tree, types.Boolean):
        return "{} != 0.0"
    if isinstance(tree, types.Integer):
        return "int({})"
    if isinstance(tree, types.Float):
        return "{}"
    raise TypingError(f"expected numbers, tuples or NamedTuples in a row, got {tree}")


def construction(tree: types.Type, number: Callable[[int], str], like: str = "") -> tuple[str, dict[str, Any]]:
    """Return source text that builds a tree of this type from its numbers, and the classes that it names.

    Args:
        tree: numba type of tuples, NamedTuples and numbers.
        number: maps a column to the source text of its number.
        like: source text of a tree that has the arrays; "" if there are none.

    Raises:
        TypingError: the tree contains another type.
    """
    names: dict[str, Any] = {}
    column = 0

    def expression(part: types.Type, path: str) -> str:
        nonlocal column
        if like and isinstance(part, types.Array):
            return path
        if not isinstance(part, types.BaseTuple):
            column += 1
            return _kind(part).format(number(column - 1))
        items = [expression(item, f"{path}[{k}]") for k, item in enumerate(part.types)]
        if isinstance(part, types.BaseNamedTuple):
            name = f"Node{len(names)}"
            names[name] = part.instance_class
            return f"{name}({', '.join(items)})"
        return f"({', '.join(items)}{',' if len(items) == 1 else ''})"

    return expression(tree, like), names


def leaves(tree: types.Type, path: str) -> list[str]:
    """Return the source text of each number of a tree of this type at `path`, in the order of the columns.

    Raises:
        TypingError: the tree contains a type other than tuples, NamedTuples and numbers.
    """
    if isinstance(tree, types.BaseTuple):
        return [leaf for k, item in enumerate(tree.types) for leaf in leaves(item, f"{path}[{k}]")]
    _kind(tree)
    return [path]


def _made(tree: types.Type) -> types.Type:
    """Return the type of a tree that is built from the numbers of a row."""
    if not isinstance(tree, types.BaseTuple):
        _kind(tree)
        return types.int64 if isinstance(tree, types.Integer) else tree
    items = [_made(item) for item in tree.types]
    return types.BaseTuple.from_types(items, getattr(tree, "instance_class", None))


def _first(context: Any, builder: Any, signature: Any, row: int, arguments: Sequence[Any]) -> Any:
    """Return the address of a row: argument `row` is the array, the following argument the row index."""
    array = context.make_array(signature.args[row])(context, builder, arguments[row])
    width = cgutils.unpack_tuple(builder, array.shape)[1]
    return builder.gep(array.data, [builder.mul(arguments[row + 1], width)])


@intrinsic
def load(typing_context: Any, like: types.Type, rows: types.Type, i: types.Type) -> tuple[Any, Callable]:
    """Return row i >= 0 of `rows` (n, width), contiguous, as a tree of the type of `like`."""
    # a source line for each number would take 1/7 of the compile time of a scene

    def generate(context: Any, builder: Any, signature: Any, arguments: Sequence[Any]) -> Any:
        first, column = _first(context, builder, signature, 1, arguments), itertools.count()

        def made(part: types.Type) -> Any:
            if isinstance(part, types.BaseTuple):
                return context.make_tuple(builder, part, [made(item) for item in part.types])
            number = builder.load(builder.gep(first, [ir.IntType(64)(next(column))]))
            return context.cast(builder, number, types.float64, part)

        return made(signature.return_type)

    return _made(like)(like, rows, types.intp), generate


@intrinsic
def store(typing_context: Any, tree: types.Type, rows: types.Type, i: types.Type) -> tuple[Any, Callable]:
    """Write a tree into row i >= 0 of `rows` (n, width), contiguous."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Sequence[Any]) -> Any:
        first, column = _first(context, builder, signature, 1, arguments), itertools.count()

        def put(part: types.Type, value: Any) -> None:
            if isinstance(part, types.BaseTuple):
                for k, item in enumerate(part.types):
                    put(item, builder.extract_value(value, k))
                return
            number = context.cast(builder, value, part, types.float64)
            builder.store(number, builder.gep(first, [ir.IntType(64)(next(column))]))

        put(signature.args[0], arguments[0])
        return context.get_dummy_value()

    leaves(tree, "tree")  # numbers only
    return types.none(tree, rows, types.intp), generate
