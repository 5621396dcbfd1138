"""Decorators of compiled functions, and the cache of their machine code; see README.md of this folder.

No fast-math flag is set: contraction would round the same source differently at different call sites, and the three
executors (multi-process, single-process, batch) must give bit-for-bit identical results.

Machine code is stored in the folder `LAPWING_CACHE`, by default ~/.cache/lapwing, and is valid until a source that can
be in it changes. Compiled again in every process: kernels of a script or notebook itself (`__main__`), and versions for
arguments whose class cannot be imported by name. Put kernels and classes into modules.
"""

from lapwing.kernels.compiler.cache import Statistics, on_compile, statistics
from lapwing.kernels.compiler.cache_files import root as cache_folder
from lapwing.kernels.compiler.decorators import (
    always_inline,
    generated,
    kernel,
    no_refcount,
    noinline,
    python_function,
    vectorise_loops,
)
from lapwing.kernels.compiler.dispatch_table import DispatchTable
from lapwing.kernels.compiler.source_digest import digest as source_digest
from lapwing.kernels.compiler.source_digest import forget as forget_sources
from lapwing.kernels.compiler.start_time import BEGAN  # noqa: F401 (first of all)

__all__ = [
    "DispatchTable",
    "Statistics",
    "always_inline",
    "cache_folder",
    "forget_sources",
    "generated",
    "kernel",
    "no_refcount",
    "noinline",
    "on_compile",
    "python_function",
    "source_digest",
    "statistics",
    "vectorise_loops",
]
