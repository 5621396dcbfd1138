"""Calls for each entry of a tuple, written out by the compiler."""

from numba.extending import overload


def each(function, count, *arguments):
    """(function(*arguments, 0), function(*arguments, 1), ...), one for each entry of the tuple `count`."""
    return tuple(function(*arguments, i) for i in range(len(count)))


@overload(each)
def _each(function, count, *arguments):
    given = "".join(f"arguments[{k}], " for k in range(len(arguments)))
    calls = "".join(f"function({given}{i}), " for i in range(len(count)))
    names: dict = {}
    exec(f"def each(function, count, *arguments):\n    return ({calls})\n", names)
    return names["each"]
