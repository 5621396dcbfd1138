"""SIMD vectors of four float64, which evaluate equal expressions for four propellers with one instruction each.

Vectors exist in compiled code only. Sums, differences, products, quotients and negation work lane by lane between
vectors and with floats, and round like float64. All functions of `lapwing.dynamics.vector` and the arithmetic of
`lapwing.dynamics.lie` accept them.
"""

# numba.core.types fills itself at import
# mypy: disable-error-code="attr-defined"

import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.typing.templates import ConcreteTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, models, register_model

from lapwing.kernels import always_inline
from lapwing.kernels.codegen import compile_source, generic
from lapwing.kernels.state_tree import NUMBERS, unroll

FLOAT, INDEX = ir.DoubleType(), ir.IntType(32)
VECTOR = ir.VectorType(FLOAT, 4)


class Float64x4Type(types.Type):
    """The numba type of a vector of four float64."""

    def __init__(self) -> None:
        super().__init__(name="Lanes")


LANES = Float64x4Type()
NUMBERS.append(Float64x4Type)


@register_model(Float64x4Type)
class _Model(models.PrimitiveModel):
    def __init__(self, dmm: Any, fe_type: Any):
        super().__init__(dmm, fe_type, VECTOR)


def _splat(builder: Any, value: Any) -> Any:
    """Return a vector with a float in every lane, or a vector unchanged."""
    if value.type == VECTOR:
        return value
    one = builder.insert_element(ir.Constant(VECTOR, ir.Undefined), value, INDEX(0))
    return builder.shuffle_vector(one, one, ir.Constant(ir.VectorType(INDEX, 4), [0] * 4))


def _binary(operation: Any, instruction: str) -> None:
    pairs = ((LANES, LANES), (LANES, types.float64), (types.float64, LANES))

    class Template(ConcreteTemplate):
        key = operation
        cases = [signature(LANES, *pair) for pair in pairs]  # noqa: RUF012

    infer_global(operation)(Template)
    for pair in pairs:

        @lower_builtin(operation, *pair)
        def _lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            return getattr(builder, instruction)(*(_splat(builder, a) for a in args))


for _operation, _instruction in (
    (operator.add, "fadd"), (operator.sub, "fsub"), (operator.mul, "fmul"), (operator.truediv, "fdiv"),
):  # fmt: skip
    _binary(_operation, _instruction)


@infer_global(operator.neg)
class _Negative(ConcreteTemplate):
    key = operator.neg
    cases = [signature(LANES, LANES)]  # noqa: RUF012


@lower_builtin(operator.neg, LANES)
def _negate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return builder.fneg(args[0])


@intrinsic
def pack4(context, a, b, c, d):
    """Return a vector of four floats."""

    def generate(context, builder, sig, args):
        vector = ir.Constant(VECTOR, ir.Undefined)
        for k, value in enumerate(args):
            vector = builder.insert_element(vector, value, INDEX(k))
        return vector

    return signature(LANES, *[types.float64] * 4), generate


@intrinsic
def splat(context, x):
    """Return a vector with one float in every lane."""
    return signature(LANES, types.float64), lambda context, builder, sig, args: _splat(builder, args[0])


@intrinsic
def unpack4(context, x):
    """Return the four floats of x as a tuple."""

    def generate(context, builder, sig, args):
        parts = [builder.extract_element(args[0], INDEX(k)) for k in range(4)]
        return context.make_tuple(builder, sig.return_type, parts)

    return signature(types.UniTuple(types.float64, 4), LANES), generate


@intrinsic
def sqrt(context, x):
    """Return the square root of every lane."""

    def generate(context, builder, sig, args):
        kind = ir.FunctionType(VECTOR, (VECTOR,))
        return builder.call(cgutils.get_or_insert_function(builder.module, kind, "llvm.sqrt.v4f64"), args)

    return signature(LANES, LANES), generate


@intrinsic
def select(context, flag, a, b):
    """Return a where flag > 0, else b, lane by lane; a and b are vectors or floats."""

    def choose(context, builder, sig, args):
        zero = ir.Constant(VECTOR, [0.0] * 4)
        return builder.select(builder.fcmp_ordered(">", args[0], zero), *(_splat(builder, a) for a in args[1:]))

    return signature(LANES, LANES, a, b), choose


@always_inline
def select_vector(flag, a, b):
    """Return the vector a if the scalar flag > 0, else the vector b."""
    return (select(flag, a[0], b[0]), select(flag, a[1], b[1]), select(flag, a[2], b[2]))


@intrinsic
def any_above(context, x):
    """Return True if any lane is above zero."""

    def generate(context, builder, sig, args):
        above = builder.fcmp_ordered(">", args[0], ir.Constant(VECTOR, [0.0] * 4))
        four = builder.bitcast(above, ir.IntType(4))
        return builder.icmp_unsigned("!=", four, four.type(0))

    return signature(types.boolean, LANES), generate


def _place(context: Any, builder: Any, array: Any, value: Any, start: Any) -> Any:
    data = context.make_array(array)(context, builder, value).data
    return builder.bitcast(builder.gep(data, [start]), VECTOR.as_pointer())


@intrinsic
def load(context, array, start):
    """Return four consecutive floats of a contiguous array from index `start`, without bounds check."""

    def generate(context, builder, sig, args):
        return builder.load(_place(context, builder, sig.args[0], *args), align=8)

    return signature(LANES, array, types.intp), generate


@intrinsic
def store(context, array, start, x):
    """Write x to the four floats that `load` would read."""

    def put(context, builder, sig, args):
        builder.store(args[2], _place(context, builder, sig.args[0], *args[:2]), align=8)
        return context.get_dummy_value()

    return signature(types.none, array, types.intp, LANES), put


@always_inline
def horizontal_sum(x):
    """Return the sum of the four lanes."""
    a, b, c, d = unpack4(x)
    return (a + b) + (c + d)


@generic(inline=True)
def interleave(four: Any) -> Callable:
    """Return the tree of vectors whose lane k holds the numbers of the k-th of four trees of equal shape."""
    paths, names = tuple(f"four[{k}]" for k in range(4)), {"pack4": pack4}
    expression = unroll(
        four.types[0], paths, lambda matched, p, _: None if matched else f"pack4({', '.join(p)})", names
    )
    return compile_source("interleave(four)", names, f"return {expression}")


@generic(inline=True)
def deinterleave(tree: Any) -> Callable:
    """Return the four trees of the lanes of a tree of vectors, as a tuple; the inverse of `interleave`."""
    names: dict[str, Any] = {"unpack4": unpack4}
    parts = [
        unroll(tree, ("tree",), lambda matched, p, _, k=k: None if matched else f"unpack4({p[0]})[{k}]", names)
        for k in range(4)
    ]
    return compile_source("deinterleave(tree)", names, f"return ({', '.join(parts)})")


@generic(inline=True)
def chunk4(values: Any, filling: Any) -> Callable:
    """Return the members of a tuple as a tuple of chunks of four; the last chunk is padded."""
    n = len(values)
    members = [f"values[{i}]" if i < n else "filling" for i in range(-(-n // 4) * 4)]
    groups = "".join(f"({', '.join(members[i : i + 4])}), " for i in range(0, len(members), 4))
    return compile_source("chunk4(values, filling)", {}, f"return ({groups})")


@generic(inline=True)
def unchunk4(groups: Any, values: Any) -> Callable:
    """Return the members of chunks of four without padding, as many as `values` has; the inverse of `chunk4`."""
    members = "".join(f"groups[{i // 4}][{i % 4}], " for i in range(len(values)))
    return compile_source("unchunk4(groups, values)", {}, f"return ({members})")
