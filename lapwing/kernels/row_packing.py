"""Trees of numbers as rows of a float64 array: how compiled code hands NamedTuples to others.

A tree is a tuple or NamedTuple of floats, integers, booleans and further trees. Every number takes one column, in
order; booleans are 0 or 1, integers are exact up to 2^53. Functions are compiled from the type of the tree, so that a
row costs as much as the numbers that are used of it.
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
    """Columns that a tree takes."""
    return sum(map(row_width, tree)) if isinstance(tree, tuple) else 1


def pack_row(tree: Any) -> np.ndarray:
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


def row_unpacker(like: Any) -> Callable[[np.ndarray], Any]:
    """A function from a row (width,) to the tree of the shape and types of `like` whose numbers stand in it."""
    result, names = construction(numba.typeof(like), lambda column: f"numbers[{column}]")
    read = compile_source("read(numbers)", names, f"return {result}")
    return lambda row: read(row.tolist())


def columns(like: Any, rows: np.ndarray) -> Any:
    """The tree of columns of `rows` (n, width): a number becomes (n,), a flat tuple of numbers (n, k)."""
    return _columns(like, rows, iter(range(rows.shape[1])))


def _columns(part: Any, rows: np.ndarray, left: Iterator[int]) -> Any:
    """Columns of `rows` that belong to this part of the tree, from the next one on.

    No inner function: its cycle of references would keep the rows.
    """
    if not isinstance(part, tuple):
        return rows[:, next(left)]
    if not any(isinstance(item, tuple) for item in part) and (not hasattr(part, "_fields") or _alike(part)):
        taken = list(islice(left, len(part)))
        return rows[:, taken[0] : taken[0] + len(taken)] if taken else rows[:, :0]
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


def _made(tree: types.Type) -> types.Type:
    """The type of a tree that is made of the numbers of a row."""
    if not isinstance(tree, types.BaseTuple):
        _kind(tree)
        return types.int64 if isinstance(tree, types.Integer) else tree
    items = [_made(item) for item in tree.types]
    return types.BaseTuple.from_types(items, getattr(tree, "instance_class", None))


def _first(context: Any, builder: Any, signature: Any, row: int, arguments: Sequence[Any]) -> Any:
    """Return the address of a row: argument `row` is the array, the next one the row number."""
    array = context.make_array(signature.args[row])(context, builder, arguments[row])
    width = cgutils.unpack_tuple(builder, array.shape)[1]
    return builder.gep(array.data, [builder.mul(arguments[row + 1], width)])


@intrinsic
def load(typing_context: Any, like: types.Type, rows: types.Type, i: types.Type) -> tuple[Any, Callable]:
    """The tree of the type of `like` in row i of `rows` (n, width), contiguous; i is not negative."""
    # a line of source for each number took a seventh of the time to compile a scene

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
    """Put a tree into row i of `rows` (n, width), contiguous; i is not negative."""

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

    leaves(tree, "tree")  # of numbers only
    return types.none(tree, rows, types.intp), generate
