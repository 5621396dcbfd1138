"""Sums over every rotor of a vehicle, whatever their number, as straight-line code."""

from lapwing.dynamics.effects._types import Loads, PerRotor
from lapwing.dynamics.vector import Vec3, add, pair
from lapwing.kernels import always_inline
from lapwing.kernels.codegen import compile_source, map_tuple, overload_for


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


def total_vector(a: tuple[Vec3, ...]) -> Vec3:
    """Return the sum of a tuple of vectors."""
    total = a[0]
    for more in a[1:]:
        total = add(total, more)
    return total


@overload_for(total_vector, inline=True)
def _total_vector(a):
    lines = [f"total = add(total, a[{i}])" for i in range(1, len(a))]
    return compile_source("total_vector(a)", {"add": add}, "total = a[0]", *lines, "return total")


def total_wrench(a: tuple[tuple[Vec3, Vec3], ...]) -> tuple[Vec3, Vec3]:
    """Return the sum of a tuple of (force [N], torque [N m])."""
    force, torque = a[0]
    for more_force, more_torque in a[1:]:
        force, torque = add(force, more_force), add(torque, more_torque)
    return force, torque


@overload_for(total_wrench, inline=True)
def _total_wrench(a):
    lines = [f"force, torque = add(force, a[{i}][0]), add(torque, a[{i}][1])" for i in range(1, len(a))]
    return compile_source("total_wrench(a)", {"add": add}, "force, torque = a[0]", *lines, "return force, torque")


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
