"""Dispatcher and cache for versions of numba that the compile pipeline does not know: numba's own compiler passes."""

import contextlib
from typing import Any

from numba.core.registry import CPUDispatcher

from lapwing.kernels.compiler.cache import KernelCache
from lapwing.kernels.compiler.file_locks import release_at_end


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
