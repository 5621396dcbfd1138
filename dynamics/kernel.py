"""The decorator of every compiled function, and where its machine code is kept.

No fast-math flag is set: contraction would let the same source round differently where it is inlined differently, and
the three speeds (processes, single, batch) must give the same bits.
"""

import hashlib
import os
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numba
import numba.core.caching

ROOT = Path(__file__).resolve().parent.parent
CACHE = Path(os.environ.get("LAPWING_CACHE", Path.home() / ".cache" / "lapwing"))
FIXED = "NUMBA_CACHE_DIR" in os.environ  # whoever sets numba's own variable decides

F = TypeVar("F", bound=Callable[..., Any])


@cache
def cache_folder(package: str) -> str:
    """Where the machine code of a package is kept: a folder for each state of the sources that can be in it.

    Numba stamps a cached function with its own file only; an edited import would keep the old machine code. The
    sources of `dynamics` can be in any kernel, those of a service in its own and in a study's, those of a study only
    in its own.

    Args:
        package: "dynamics", a service's "services.NAME", or a study's "studies.NAME".
    """
    digest = hashlib.blake2b(digest_size=8)
    services = {"services"} if package.startswith("studies.") else set()
    for folder in sorted({"dynamics", package.replace(".", "/")} | services):
        for path in sorted((ROOT / folder).rglob("*.py")):
            digest.update(str(path.relative_to(ROOT)).encode())
            digest.update(path.read_bytes())
    return str(CACHE / "kernels" / f"{package}-{digest.hexdigest()}")


_load_index = numba.core.caching.IndexDataCacheFile._load_index


def _readable_index(self: Any) -> dict:
    """Numba's index of compiled versions; empty where it names classes that this process cannot import.

    The index of a kernel that many use, a step of an integrator, names the argument classes of all who have used it.
    """
    try:
        return _load_index(self)
    except (ImportError, AttributeError):
        return {}


numba.core.caching.IndexDataCacheFile._load_index = _readable_index


def _compile(function: Callable, **options: bool) -> Any:
    if not FIXED:
        first, _, rest = function.__module__.partition(".")
        package = f"{first}.{rest.partition('.')[0]}" if first in ("services", "studies") else "dynamics"
        numba.config.CACHE_DIR = cache_folder(package)
    return numba.njit(cache=True, error_model="numpy", nogil=True, **options)(function)


def kernel(function: F) -> F:
    """Compile a pure function: cached on disk, releases the GIL, divides as IEEE 754 says (no ZeroDivisionError)."""
    return _compile(function)


def leaf(function: F) -> F:
    """The same for small functions that are always inlined into their caller."""
    return _compile(function, forceinline=True)
