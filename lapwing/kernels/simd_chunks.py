"""Any number of things in groups of four, for the lanes of `lapwing.kernels.simd`."""

from collections.abc import Callable
from typing import Any

from lapwing.kernels.codegen import define, generated


def _in_fours(values: Any, filling: Any) -> Callable:
    n = len(values)
    members = [f"values[{i}]" if i < n else "filling" for i in range(-(-n // 4) * 4)]
    groups = "".join(f"({', '.join(members[i : i + 4])}), " for i in range(0, len(members), 4))
    return define("in_fours(values, filling)", {}, f"return ({groups})")


in_fours = generated(
    "in_fours(values, filling)",
    _in_fours,
    "The members of a tuple as a tuple of groups of four, the last one filled up.",
    inline=True,
)


def _one_by_one(groups: Any, values: Any) -> Callable:
    members = "".join(f"groups[{i // 4}][{i % 4}], " for i in range(len(values)))
    return define("one_by_one(groups, values)", {}, f"return ({members})")


one_by_one = generated(
    "one_by_one(groups, values)",
    _one_by_one,
    "The members of groups of four, without the filling, as many as there are `values`; the inverse of `in_fours`.",
    inline=True,
)
