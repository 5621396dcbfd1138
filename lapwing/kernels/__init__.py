"""The decorator of every compiled function, and where its machine code is kept.

No fast-math flag is set: contraction would let the same source round differently where it is inlined differently, and
the three speeds (processes, single, batch) must give the same bits.

Machine code is kept in the folder `LAPWING_CACHE`, by default ~/.cache/lapwing, by a cache of this package's own; what
numba keeps for other functions is left alone. It is found again while no source that can be in it has changed (see
`_key`); what another process is compiling is waited for (`_locks`). Compiled anew in every process are kernels in a
script or notebook itself (`__main__`), and versions for arguments that are functions or whose class cannot be imported
by name: put kernels and classes into modules.
"""

from lapwing.kernels.compiler.cache import Statistics, on_compile, statistics
from lapwing.kernels.compiler.cache_files import root as cache_folder
from lapwing.kernels.compiler.decorators import (
    always_inline,
    kernel,
    no_refcount,
    noinline,
    python_function,
    uncached,
    vectorise_loops,
)
from lapwing.kernels.compiler.dispatch_table import DispatchTable
from lapwing.kernels.compiler.pipeline import Pipeline
from lapwing.kernels.compiler.source_digest import digest as source_digest
from lapwing.kernels.compiler.source_digest import forget as forget_sources
from lapwing.kernels.compiler.start_time import BEGAN  # noqa: F401 (first of all)

__all__ = [
    "DispatchTable",
    "Pipeline",
    "Statistics",
    "always_inline",
    "cache_folder",
    "forget_sources",
    "kernel",
    "no_refcount",
    "noinline",
    "on_compile",
    "python_function",
    "source_digest",
    "statistics",
    "uncached",
    "vectorise_loops",
]
