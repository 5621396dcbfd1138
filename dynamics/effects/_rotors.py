"""The same function over every rotor or foot of a vehicle, whatever their number, as straight-line code."""

from numba.extending import overload

from dynamics.vector import add

INLINE = {"forceinline": True}


def each(function, c, a, b):
    """(function(c, a[0], b[0]), function(c, a[1], b[1]), ...) for a compiled function and tuples of equal length."""
    return tuple(function(c, x, y) for x, y in zip(a, b, strict=True))


@overload(each, jit_options=INLINE)
def _each(function, c, a, b):
    calls = "".join(f"function(c, a[{i}], b[{i}]), " for i in range(len(a)))
    names: dict = {}
    exec(f"def each(function, c, a, b):\n    return ({calls})\n", names)
    return names["each"]


def total(a):
    """Sum of a tuple, added in pairs: a shorter chain of dependent additions."""
    return sum(a)


@overload(total, jit_options=INLINE)
def _total(a):
    def pairs(terms):
        half = len(terms) // 2
        return terms[0] if len(terms) == 1 else f"({pairs(terms[:half])} + {pairs(terms[half:])})"

    names: dict = {}
    exec(f"def total(a):\n    return {pairs([f'a[{i}]' for i in range(len(a))])}\n", names)
    return names["total"]


def total_wrench(a):
    """Sum of a tuple of (force, torque)."""
    raise NotImplementedError("compiled code only")


@overload(total_wrench, jit_options=INLINE)
def _total_wrench(a):
    lines = ["def total_wrench(a):", "    force, torque = a[0]"]
    lines += [f"    force, torque = add(force, a[{i}][0]), add(torque, a[{i}][1])" for i in range(1, len(a))]
    names: dict = {"add": add}
    exec("\n".join([*lines, "    return force, torque"]), names)
    return names["total_wrench"]
