"""Disk cache of one kernel: a file for each compiled version, named by its key."""

import contextlib
import copy
import pickle
import warnings
from collections.abc import Callable
from typing import Any, NamedTuple

from numba.core import sigutils
from numba.core.caching import _Cache
from numba.core.compiler import CompileResult
from numba.core.dispatcher import Dispatcher
from numba.core.errors import NumbaWarning
from numba.core.runtime import rtsys
from numba.core.serialize import dumps

from lapwing.kernels.compiler import cache_files, file_locks, source_digest
from lapwing.kernels.compiler.cache_key import Key, NotKeptError, key


class Statistics(NamedTuple):
    """Number of kernel versions that this process has compiled and loaded."""

    compiled: int
    loaded: int  # number loaded from disk, with all kernels that they call


_HASH_SECRET = b"_numba_hashsecret_"  # in the machine code of kernels that hash texts
_counted = {"compiled": 0, "loaded": 0}
_listeners: list[Callable[[str], None]] = []


def statistics() -> Statistics:
    """Return the numbers of kernel versions that this process has compiled and loaded."""
    return Statistics(**_counted)


def on_compile(listener: Callable[[str], None]) -> None:
    """Call `listener` with the name of every kernel ("module.function") before it is compiled.

    The listener is also called before this process waits for another process that compiles the kernel.
    """
    _listeners.append(listener)


class KernelCache(_Cache):
    """Store of one kernel's machine code below `cache_files.root()`; it stores nothing if it cannot write."""

    def __init__(self, dispatcher: Dispatcher):
        self._dispatcher = dispatcher
        function = dispatcher.py_func
        self._label = f"{function.__module__}.{function.__qualname__}"
        self._folder = f"kernels/{function.__module__}"
        self._name = "".join(c for c in function.__qualname__ if c.isalnum() or c in "._")[:80]
        self._enabled = True

    @property
    def cache_path(self) -> str | None:
        """The folder of this kernel's files."""
        root = cache_files.root()
        return str(root / self._folder) if root else None

    def enable(self) -> None:
        """Enable loading and storing of versions."""
        self._enabled = True

    def disable(self) -> None:
        """Disable loading and storing of versions."""
        self._enabled = False

    def flush(self) -> None:
        """Delete every version of this kernel."""
        cache_files.remove(self._folder, self._name)

    def load_overload(self, sig: Any, target_context: Any) -> CompileResult | None:
        """Return the version for a signature, or None if it must be compiled.

        Numba's implementations of Python's functions are not set up: only a compilation needs them, and sets them up
        itself. They take half of the processor time of loading the kernels of a run.
        """
        rtsys.initialize(target_context)
        current = self._key(sig, target_context.codegen()) if self._enabled else None
        result = self._load(current, sig, target_context)
        if result is None:
            for listener in _listeners:
                listener(self._label)
            if current:
                file_locks.acquire(f"{self._folder}/{self._file(current, self._is_inner())}-{current.sources}")
                result = self._load(current, sig, target_context)
        if result is not None:
            _counted["loaded"] += 1
        return result

    def save_overload(self, sig: Any, data: CompileResult) -> None:
        """Store a newly compiled version."""
        _counted["compiled"] += 1
        if data.lifted or data.library.has_dynamic_globals:
            warnings.warn(f"{self._label} is not stored on disk: it uses addresses of this process", NumbaWarning, 2)
            return
        current = self._key(sig, data.codegen) if self._enabled else None
        if current is not None:
            name = self._file(current, self._is_inner(data))
            cache_files.write(self._folder, name, current.sources, dumps((current, self._reduce(data))))

    def _load(self, current: Key | None, sig: Any, target_context: Any) -> CompileResult | None:
        inner = self._is_inner()
        content = cache_files.read(self._folder, self._file(current, inner), current.sources) if current else None
        if content is None:
            return None
        if _HASH_SECRET in content:  # numba defines these symbols with its implementations
            target_context.refresh()
        with contextlib.suppress(Exception):  # any error here only leads to a new compilation
            stored, (code, fndesc, environment, signature, *rest) = pickle.loads(content)
            if stored == current:
                fndesc.argtypes = sigutils.normalize_signature(sig)[0]
                signature = signature.replace(args=fndesc.argtypes)
                return self._rebuild(target_context, (code, fndesc, environment, signature, *rest))
        return None

    def _is_inner(self, result: CompileResult | None = None) -> bool:
        """Return True if a result is code for other kernels only; without a result, test the next one."""
        return False

    def _reduce(self, result: CompileResult) -> tuple:
        """Return the stored parts of a result.

        Types of arguments are left out: the key has them, and numba would restore functions as other types.
        """
        code, fndesc, environment, signature, *rest = result._reduce()
        fndesc = copy.copy(fndesc)
        fndesc.argtypes = ()
        return code, fndesc, environment, signature.replace(args=()), *rest

    def _rebuild(self, target_context: Any, payload: tuple) -> CompileResult:
        """Return the result that is rebuilt from its stored parts."""
        return CompileResult._rebuild(target_context, *payload)

    def _file(self, current: Key, inner: bool) -> str:
        return f"{self._name}-{'inner-' if inner else ''}{current.made_of}"

    def _key(self, sig: Any, codegen: Any) -> Key | None:
        arguments, returns = sigutils.normalize_signature(sig)
        try:
            current = key(self._dispatcher, arguments, returns, codegen.magic_tuple())
        except NotKeptError:
            return None
        return current if source_digest.sources_are_current(current.modules) else None
