"""Sums over all rotors of a vehicle, as straight-line code for any number."""

from lapwing.dynamics.effects._types import Loads, PerRotor
from lapwing.dynamics.vector import add, pair
from lapwing.kernels import always_inline
from lapwing.kernels.codegen import compile_source, map_tuple, overload_for, reduce_tuple


def total(a: PerRotor) -> float:
    """Return the sum of a tuple, added in pairs for a shorter chain of dependent additions."""
    half = len(a) // 2
    return a[0] if len(a) == 1 else total(a[:half]) + total(a[half:])


@overload_for(total, inline=True)
def _total(a):
    def pairs(terms):
        half = len(terms) // 2
        return terms[0] if len(terms) == 1 else f"({pairs(terms[:half])} + {pairs(terms[half:])})"

    return compile_source("total(a)", {}, f"return {pairs([f'a[{i}]' for i in range(len(a))])}")


@always_inline
def _add_vector(_, total, a, same):
    return add(total, a)


@always_inline
def total_vector(a):
    """Return the sum of a tuple of vectors."""
    return reduce_tuple(_add_vector, 0.0, a[0], a[1:], a[1:])


@always_inline
def _add_wrench(_, total, a, same):
    return add(total[0], a[0]), add(total[1], a[1])


@always_inline
def total_wrench(a):
    """Return the sum of a tuple of (force [N], torque [N m])."""
    return reduce_tuple(_add_wrench, 0.0, a[0], a[1:], a[1:])


@always_inline
def _more_thrust(density, before, both):
    factor, change = both
    return before + density * factor * change[0]


@always_inline
def _more_torque(density, before, both):
    factor, change = both
    return before + density * factor * change[1]


@always_inline
def with_changes(s, factors, loads, change):
    """Return the loads with the change (thrust [N], torque [N m]) of each rotor at a density of 1 added."""
    return Loads(
        map_tuple(_more_thrust, s.air.density, loads.thrust, map_tuple(pair, 0.0, factors.thrust, change)),
        map_tuple(_more_torque, s.air.density, loads.torque, map_tuple(pair, 0.0, factors.torque, change)),
    )
