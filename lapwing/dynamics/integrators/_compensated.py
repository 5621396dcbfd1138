"""Compensated summation: a state with the rounding errors of the sums that made it (theory, eq. (2.79)).

Kahan, Comm. ACM 8 (1965) 40; Moeller, BIT 5 (1965) 37 and 251; for steps of an integrator Hairer, Lubich, Wanner,
Geometric Numerical Integration, section VIII.5.
"""

from typing import Any, NamedTuple

from numba import types

from lapwing.kernels import DispatchTable, always_inline
from lapwing.kernels.codegen import generic
from lapwing.kernels.state_tree import axpy, normalise, rounding_error, scale

INCREMENTS, ORDERS = DispatchTable("increment"), DispatchTable("ORDER")
"""`increment` and `ORDER` of a method, by its `Method`."""


class CompensatedSummation(NamedTuple):
    """Choice of compensated sums, by its class: kernels without it do not contain them."""


class CompensatedSum(NamedTuple):
    """A state whose numbers are sums of two doubles."""

    value: Any  # tree of numbers
    remainder: Any  # of the same shape, at most half a unit in the last place of the value


@generic(inline=True)
def exact(summation, method, x):
    """Return the state x as a CompensatedSum if that is the choice and the method has increments; else x."""
    chosen = getattr(summation, "instance_class", None) is CompensatedSummation
    if chosen and INCREMENTS.get(method.instance_class):
        return lambda summation, method, x: CompensatedSum(x, scale(0.0, x))
    return lambda summation, method, x: x


def is_compensated(x: types.Type) -> bool:
    """Return True if the type of a state is that of a CompensatedSum."""
    return getattr(x, "instance_class", None) is CompensatedSum


@always_inline
def add(x, v):
    """Return the CompensatedSum x + v for a tree v of numbers."""
    v = axpy(1.0, x.remainder, v)
    value = axpy(1.0, v, x.value)
    return CompensatedSum(value, rounding_error(x.value, v, value))


@always_inline
def difference(x, y):
    """Return the tree x - y of two CompensatedSums that are close to one another."""
    return axpy(1.0, axpy(-1.0, y.remainder, x.remainder), axpy(-1.0, y.value, x.value))


@generic(inline=True)
def value_of(x):
    """Return the value of a CompensatedSum; any other tree itself."""
    return (lambda x: x.value) if is_compensated(x) else (lambda x: x)


@generic(inline=True)
def rounded(x):
    """Return the state on the manifold that a CompensatedSum is nearest to; any other tree itself."""
    return (lambda x: normalise(x.value)) if is_compensated(x) else (lambda x: x)


@generic(inline=True)
def extrapolate(method, halves, whole):
    """Return the result of two half steps without the leading term of its error (theory, eq. (2.33))."""
    share = 1.0 / (2.0 ** ORDERS[method.instance_class] - 1.0)
    if is_compensated(halves):
        return lambda method, halves, whole: add(halves, scale(share, difference(halves, whole)))
    return lambda method, halves, whole: normalise(axpy(share, axpy(-1.0, whole, halves), halves))
