"""Syntax trees of Python source, parsed by one thread at a time.

Up to 3.11.7 and 3.12.1 Python ends in a SystemError when two threads parse at once (python/cpython issue 106905).
"""

import ast
import threading
from typing import Any

_LOCK = threading.Lock()


def parse(source: str | bytes, mode: str = "exec") -> Any:
    """Return the tree of `ast.parse`."""
    with _LOCK:
        return ast.parse(source, mode=mode)
