"""Differential equations of an FMU for model exchange, as a system for Lapwing's integrators.

The compiled rate calls the functions of the FMU by their addresses, so all FMUs share its machine code.
"""

# numba.core.types fills itself at import
# mypy: disable-error-code="attr-defined"

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic

from lapwing.dynamics.integrators import RATES, StepDoubling, integrate_step_doubling
from lapwing.kernels import always_inline, kernel

WARNING = 1  # highest FMI status of success


class FmuFunctions(NamedTuple):
    """Addresses of functions of an FMU, of its instance, and of an int64 that receives the status of a failed call."""

    set_time: int
    set_states: int
    get_derivatives: int
    component: int
    status: int


@intrinsic
def _call(
    typing_context: Any, set_time: Any, set_states: Any, derivatives: Any, component: Any, status: Any, t: Any, x: Any
) -> tuple[Any, Callable]:
    n = len(x)
    double, int32, int64 = ir.DoubleType(), ir.IntType(32), ir.IntType(64)
    pointer = ir.IntType(8).as_pointer()

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Sequence[ir.Value]) -> ir.Value:
        to_time, to_states, to_derivatives, instance, failed, time, states = arguments
        array = cgutils.alloca_once(builder, double, size=n)
        for i in range(n):
            builder.store(builder.extract_value(states, i), builder.gep(array, [ir.Constant(int64, i)]))
        instance = builder.inttoptr(instance, pointer)
        of_time = ir.FunctionType(int32, [pointer, double]).as_pointer()
        of_states = ir.FunctionType(int32, [pointer, double.as_pointer(), int64]).as_pointer()
        results = [builder.call(builder.inttoptr(to_time, of_time), [instance, time])]
        for address in (to_states, to_derivatives):
            function = builder.inttoptr(address, of_states)
            results.append(builder.call(function, [instance, array, ir.Constant(int64, n)]))
        worst = results[0]
        for each in results[1:]:
            worst = builder.select(builder.icmp_signed(">", each, worst), each, worst)
        bad = builder.icmp_signed(">", worst, ir.Constant(int32, WARNING))
        with builder.if_then(bad, likely=False):
            builder.store(builder.sext(worst, int64), builder.inttoptr(failed, int64.as_pointer()))
        result = cgutils.get_null_value(context.get_value_type(signature.return_type))
        nan = ir.Constant(double, float("nan"))
        for i in range(n):
            value = builder.load(builder.gep(array, [ir.Constant(int64, i)]))
            result = builder.insert_value(result, builder.select(bad, nan, value), i)
        return result

    return x(*[types.int64] * 5, types.float64, x), generate


@always_inline
def rate(p: Any, t: float, x: Any) -> Any:
    """Return the derivatives of the states, NaN where the FMU reports an error."""
    return _call(p.set_time, p.set_states, p.get_derivatives, p.component, p.status, t, x)


RATES[FmuFunctions] = rate


@kernel
def advance_states(method: Any, accuracy: float, p: FmuFunctions, t: float, x: Any, end: float) -> Any:
    """Return the states at `end` by step doubling of a method from the states x at t."""
    return integrate_step_doubling(StepDoubling(method, accuracy), p, t, x, end - t, end)
