"""Tuples split into chunks of four, for the vectors of `lapwing.kernels.simd`."""

from collections.abc import Callable
from typing import Any

from lapwing.kernels.codegen import compile_source, generic


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
