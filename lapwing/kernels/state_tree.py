"""Generic operations on states, which are trees of tuples and NamedTuples of any shape.

A leaf is a float, or an instance of a registered manifold class (`Quaternion`, `Direction`, ...). A tangent has the
shape of the state with every manifold leaf replaced by the tuple of its tangent coordinates. Each operation is compiled
from the *type* of the state: the tree is unrolled into straight-line code, which has no run-time cost and is stored in
the disk cache. Called from Python, the generated code runs uncompiled (slow; use it in tests and configuration only).
"""

# numba.core.types fills itself at import
# mypy: disable-error-code="attr-defined"

import itertools
from collections.abc import Callable
from typing import Any, NamedTuple

from numba.core import types
from numba.core.errors import TypingError

from lapwing.kernels import DispatchTable
from lapwing.kernels.codegen import compile_source, generic


class Manifold(NamedTuple):
    """Operations of a manifold leaf class: compiled functions, u and v in its tangent coordinates.

    The tangent space at every point is one Lie algebra that acts on the manifold (theory, section 5.1).
    """

    retract: Callable  # (x, v) -> the point that the exponential of v takes x to
    embed: Callable  # (x, v) -> time derivative of the stored numbers of x, as a tuple
    normalise: Callable  # (x) -> the nearest point on the manifold
    bracket: (
        Callable  # (u, v) -> [u, v], signed so that retract(x, u)' = v means u' = v - [u, v]/2 + [u, [u, v]]/12 - ...
    )
    transport: Callable  # (u, v) -> v parallel-transported from retract(x, u) back to x along the geodesic


MANIFOLDS = DispatchTable()
NUMBERS: list[type] = [types.Float]
"""Numba types of the numbers of a tree; `simd` adds its vectors."""


def _leaf_class(tree: types.Type) -> type | None:
    result = getattr(tree, "instance_class", None)
    return result if result in MANIFOLDS else None


def unroll(tree: types.Type, paths: tuple[str, ...], rule: Callable, names: dict[str, Any]) -> str:
    """Return the source of the tree whose leaves are `rule(leaf class or None for a float, paths, names)`.

    If a rule returns None for a manifold class, it is called for each stored number of that leaf instead.
    """
    if isinstance(tree, tuple(NUMBERS)):
        return rule(None, paths, names)
    leaf = _leaf_class(tree)
    if leaf and (expression := rule(leaf, paths, names)):
        return expression
    if isinstance(tree, types.NoneType):
        return "None"
    if not isinstance(tree, types.BaseTuple):
        raise TypingError(f"expected floats, tuples or manifold leaves in a state, got {tree}")
    parts = [unroll(part, tuple(f"{a}[{i}]" for a in paths), rule, names) for i, part in enumerate(tree.types)]
    if isinstance(tree, types.BaseNamedTuple):
        name = f"Node{len(names)}"
        names[name] = tree.instance_class
        return f"{name}({', '.join(parts)})"
    return f"({', '.join(parts)}{',' if len(parts) == 1 else ''})"


def _operation(signature: str, shape: str, body: Callable, doc: str) -> Callable:
    """Return the generic function `signature` with the source `body(type of the argument shape, names)`."""
    position = signature.rstrip(")").partition("(")[2].split(", ").index(shape)

    def generate(*argument_types):
        names: dict[str, Any] = {}
        expression = body(argument_types[position], names)
        return compile_source(signature, names, f"return {expression}")

    generate.__name__ = generate.__qualname__ = signature.partition("(")[0]
    generate.__doc__ = doc
    return generic()(generate)


def _of_manifold(operation: str, paths: tuple[str, ...], takes: slice, on_float: str) -> Callable:
    """Return a body that maps a `Manifold` operation over the leaves and the template `on_float` over the floats."""

    def rule(leaf, paths, names):
        if leaf is None:
            return on_float.format(*paths)
        function = f"{operation}_{leaf.__name__}"
        names[function] = getattr(MANIFOLDS[leaf], operation)
        return f"{function}({', '.join(paths[takes])})"

    return lambda tree, names: unroll(tree, paths, rule, names)


def _of_numbers(paths: tuple[str, ...], template: str) -> Callable:
    """Return a body that maps a template over every stored number."""
    return lambda tree, names: unroll(tree, paths, lambda leaf, p, _: None if leaf else template.format(*p), names)


def _number_paths(tree: types.Type, path: str) -> list[str]:
    """Return the expressions of all stored numbers of a tree, in order."""
    result: list[str] = []

    def rule(leaf, paths, _):
        if leaf is None:
            result.append(paths[0])
        return None if leaf else paths[0]

    unroll(tree, (path,), rule, {})
    return result


def _flatten(tree: types.Type, names: dict[str, Any]) -> str:
    return f"({' '.join(f'{path},' for path in _number_paths(tree, 'x'))})"


def _largest(tree: types.Type, names: dict[str, Any]) -> str:
    return f"max(0.0, {', '.join(f'abs({path})' for path in _number_paths(tree, 'v'))})"


def _finite(tree: types.Type, names: dict[str, Any]) -> str:
    # NaN and infinity times zero are NaN
    return f"{' + '.join(f'0.0 * {path}' for path in _number_paths(tree, 'x'))} == 0.0"


def _error_ratio(tree: types.Type, names: dict[str, Any]) -> str:
    def rule(leaf, paths, _):
        x, e = paths
        result.append(f"abs({e}) / (1.0 + abs({x}))" if leaf is None else f"largest({e})")
        return x

    result: list[str] = []
    unroll(tree, ("x", "e"), rule, names)
    names["largest"] = largest
    return f"max(0.0, {', '.join(result)})"


def _relative_difference(tree: types.Type, names: dict[str, Any]) -> str:
    names["of_part"] = relative_difference
    result = []
    for i, part in enumerate(tree.types):  # types of tuples are requested often
        if isinstance(part, types.BaseTuple):
            result.append(f"of_part(x[{i}], y[{i}])")
        else:
            result += [f"abs({n} - y{n[1:]}) / (1.0 + abs({n}))" for n in _number_paths(part, f"x[{i}]")]
    return f"max(0.0, 0.0, {', '.join(result)})"


def _unflatten(tree: types.Type, names: dict[str, Any]) -> str:
    index = itertools.count()
    return unroll(tree, (), lambda leaf, _, __: None if leaf else f"numbers[{next(index)}]", names)


retract = _operation(
    "retract(x, v)", "x", _of_manifold("retract", ("x", "v"), slice(0, 2), "{0} + {1}"),
    "Return the state reached from x along the tangent v: group exponential on manifold leaves, x + v on floats.",
)  # fmt: skip
embed = _operation(
    "embed(x, v)", "x", _of_manifold("embed", ("x", "v"), slice(0, 2), "{1}"),
    "Return the time derivative of the stored numbers of the state x that moves with tangent v.",
)  # fmt: skip
normalise = _operation(
    "normalise(x)", "x", _of_manifold("normalise", ("x",), slice(0, 1), "{0}"),
    "Return the state with every manifold leaf projected onto its manifold.",
)  # fmt: skip
bracket = _operation(
    "bracket(x, u, v)", "x", _of_manifold("bracket", ("x", "u", "v"), slice(1, 3), "0.0"),
    "Return the Lie bracket [u, v] of two tangents at x, signed as `Manifold.bracket`; zero on floats.",
)  # fmt: skip
transport = _operation(
    "transport(x, u, v)", "x", _of_manifold("transport", ("x", "u", "v"), slice(1, 3), "{2}"),
    "Return the tangent v at retract(x, u), parallel-transported back to x.",
)  # fmt: skip
axpy = _operation(
    "axpy(a, v, y)", "y", _of_numbers(("v", "y"), "{1} + a * {0}"),
    "Return y + a v number by number for a scalar a; y is a tangent, or a state with embedded derivative v.",
)  # fmt: skip
scale = _operation("scale(a, v)", "v", _of_numbers(("v",), "a * {0}"), "Return a v for a scalar a and a tangent v.")
rounding_error = _operation(
    "rounding_error(x, v, s)", "x", _of_numbers(("x", "v", "s"), "({0} - ({2} - ({2} - {0}))) + ({1} - ({2} - {0}))"),
    "Return the error x + v - s of the rounded sum s of two trees, exactly (theory, eq. (2.79)).",
)  # fmt: skip
flatten = _operation("flatten(x)", "x", _flatten, "Return every stored number of a state or tangent as one flat tuple.")
largest = _operation("largest(v)", "v", _largest, "Return the largest absolute number of a state or tangent.")
error_ratio = _operation(
    "error_ratio(x, e)", "x", _error_ratio,
    "Return the largest component of a tangent e at x, relative to 1 + |x| for floats, absolute for manifold leaves.",
)  # fmt: skip
relative_difference = _operation(
    "relative_difference(x, y)", "x", _relative_difference,
    "Return the largest difference of stored numbers of two states, relative to 1 + |x|; NaN is ignored.",
)  # fmt: skip
finite = _operation("finite(x)", "x", _finite, "Return True if all numbers of a state or tangent are finite.")
unflatten = _operation(
    "unflatten(x, numbers)", "x", _unflatten,
    "Return the state of the shape of x that holds `numbers` (flat tuple or array row); inverse of `flatten`.",
)  # fmt: skip
