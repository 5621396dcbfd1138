"""Pure functions of doubles in compiled code, each with a variant for vectors of doubles that vectorised loops call.

LLVM replaces a call in a loop by a call of the variant that the attribute `vector-function-abi-variant` names. The
variant has a loop over the numbers of its vectors with the function inlined into it, which LLVM vectorises in turn.
Each operation is one of IEEE 754, so the bits are those of the function.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from llvmlite import ir
from numba.core import cgutils

from lapwing.kernels.compiler.call_convention import WIDEST, ValueCallConv
from lapwing.kernels.math.reduction import LARGEST

_PURE = ("memory(none)", "nounwind", "willreturn", "noinline")
_DOUBLE, _INDEX = ir.DoubleType(), ir.IntType(64)


def vector_width(features: str) -> int:
    """Return the number of doubles in a vector register of a processor with these features, in LLVM's notation."""
    if "+avx512f" in features:
        return 8
    return 4 if "+avx" in features else 2


class PureFunction(NamedTuple):
    """Name and sizes of a function."""

    symbol: str
    arguments: int
    results: int
    width: int  # of the vectors of its variant

    def declare(self, module: Any) -> Any:
        """Return the function in a module."""
        variant = f"_ZGV_LLVM_N{self.width}{'v' * self.arguments}_{self.symbol}({self.symbol}.v{self.width})"
        return self._declare(module, self.symbol, _DOUBLE, f'"vector-function-abi-variant"="{variant}"')

    def _declare(self, module: Any, name: str, number: Any, *attributes: str) -> Any:
        if name in module.globals:
            return module.globals[name]
        returns = ir.LiteralStructType([number] * self.results) if self.results > 1 else number
        function = ir.Function(module, ir.FunctionType(returns, [number] * self.arguments), name)
        for attribute in (*_PURE, *attributes):
            set.add(function.attributes, attribute)  # llvmlite rejects some of them as unknown
        return function

    def define(self, context: Any, module: Any, kernel: Any) -> None:
        """Define the function by the descriptor of a kernel that raises nothing."""
        function = self.declare(module)
        builder = ir.IRBuilder(function.append_basic_block())
        _return(builder, _caller(context, builder, kernel)(function.args))

    def define_variant(self, context: Any, module: Any, kernel: Any, of_small: Any) -> None:
        """Define the variant for vectors.

        Args:
            kernel: descriptor of the kernel.
            of_small: descriptor of the kernel for one argument up to `LARGEST`, or None.
        """
        vector = ir.VectorType(_DOUBLE, self.width)
        function = self._declare(module, f"{self.symbol}.v{self.width}", vector, WIDEST)
        builder = ir.IRBuilder(function.append_basic_block())
        spaces = [builder.alloca(ir.ArrayType(_DOUBLE, self.width)) for _ in range(self.arguments + self.results)]
        pointers = [builder.bitcast(space, vector.as_pointer()) for space in spaces]

        def compute(call: Callable[[Sequence], list], index: Any) -> None:
            numbers = [builder.gep(space, [_INDEX(0), index]) for space in spaces]
            results = call([builder.load(number) for number in numbers[: self.arguments]])
            for result, number in zip(results, numbers[self.arguments :], strict=True):
                builder.store(result, number)

        def loop() -> None:
            with cgutils.for_range(builder, _INDEX(self.width)) as each:
                compute(call, each.index)

        def call_function(numbers: Sequence) -> list:
            return _unpack(builder, builder.call(self.declare(module), numbers))

        call = _caller(context, builder, of_small or kernel)
        for argument, pointer in zip(function.args, pointers, strict=False):
            builder.store(argument, pointer, align=8)
        if of_small is None:
            loop()
        else:
            with builder.if_else(_any_large(builder, function.args[0]), likely=False) as (large, small):
                with large:
                    for k in range(self.width):  # not a loop, which LLVM would replace by a call of this variant
                        compute(call_function, _INDEX(k))
                with small:
                    loop()
        _return(builder, [builder.load(pointer, align=8) for pointer in pointers[self.arguments :]])


def _caller(context: Any, builder: Any, kernel: Any) -> Callable[[Sequence], list]:
    """Return the function that calls a kernel with numbers and returns its results."""
    function = ValueCallConv(context).declare(builder.module, kernel)
    function.attributes.add("alwaysinline")
    place, error = (builder.alloca(argument.type.pointee) for argument in function.args[:2])

    def call(numbers: Sequence) -> list:
        builder.call(function, [place, error, *numbers])
        return _unpack(builder, builder.load(place))

    return call


def _any_large(builder: Any, x: Any) -> Any:
    """Return the condition that the magnitude of a number of a vector is above `LARGEST`."""
    kind = ir.FunctionType(x.type, [x.type])
    size = builder.call(cgutils.get_or_insert_function(builder.module, kind, f"llvm.fabs.v{x.type.count}f64"), [x])
    above = builder.fcmp_ordered(">", size, ir.Constant(x.type, [LARGEST] * x.type.count))
    flags = builder.bitcast(above, ir.IntType(x.type.count))
    return builder.icmp_unsigned("!=", flags, flags.type(0))


def _unpack(builder: Any, value: Any) -> list:
    """Return the numbers of a value that is a number or several of them."""
    return [value] if value.type == _DOUBLE else cgutils.unpack_tuple(builder, value)


def _return(builder: Any, values: list) -> None:
    """Return a value, or a struct of several."""
    if len(values) == 1:
        builder.ret(values[0])
        return
    struct = ir.Constant(builder.function.function_type.return_type, ir.Undefined)
    for k, value in enumerate(values):
        struct = builder.insert_value(struct, value, k)
    builder.ret(struct)
