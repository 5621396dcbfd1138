"""Versions of numba and llvmlite that the compile pipeline works with, and compilation with any other version.

Other versions compile with numba's own passes.
"""

import contextlib
import os
import re
import sys
from typing import Any

import llvmlite
import numba
from numba.core.registry import CPUDispatcher

from lapwing.kernels.compiler.cache import KernelCache
from lapwing.kernels.compiler.file_locks import release_at_end

NUMBA = (0, 63), (0, 68)  # oldest and newest minor version, both included
LLVMLITE = (0, 46), (0, 50)
_REPORTED = "LAPWING_NUMBA_REPORTED"  # set for child processes, so that a run prints the line once


def _is_within(version: str, oldest: tuple[int, int], newest: tuple[int, int]) -> bool:
    """Return True if a version text such as "0.68.1" has a minor version in the range."""
    match = re.match(r"(\d+)\.(\d+)", version)
    return match is not None and oldest <= (int(match[1]), int(match[2])) <= newest


def is_supported() -> bool:
    """Return True if the installed numba and llvmlite are known to work with the pipeline.

    For other versions, print one line to the standard error stream, once per run.
    """
    if _is_within(numba.__version__, *NUMBA) and _is_within(llvmlite.__version__, *LLVMLITE):
        return True
    if _REPORTED not in os.environ:
        os.environ[_REPORTED] = "1"
        oldest, newest = (f"{major}.{minor}" for major, minor in NUMBA)
        print(
            f"lapwing: numba {numba.__version__} with llvmlite {llvmlite.__version__} is not tested: kernels compile "
            f"with numba's own passes, more slowly, with equal results; install numba {oldest} to {newest}",
            file=sys.stderr,
        )
    return False


class PlainCache(KernelCache):
    """Kernel cache that compiles again where a version of numba cannot store or restore a result."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the stored version for a signature; None if it must be compiled."""
        with contextlib.suppress(Exception):
            return super().load_overload(sig, target_context)
        return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Store a compiled version where that is possible."""
        with contextlib.suppress(Exception):
            super().save_overload(sig, data)


class PlainDispatcher(CPUDispatcher):
    """numba's dispatcher; releases the locks that the cache takes while a kernel compiles."""

    def compile(self, sig: Any) -> Any:
        """Return the entry point of the version for a signature."""
        with release_at_end():
            return super().compile(sig)
