"""What the class that declares a table says of its keys in comments.

The unit and the meaning of a key stand in the comment behind its field (`# [m] of one foot`), and nowhere else.
"""

import ast
import inspect
import io
import re
import sys
import tokenize
from functools import cache
from types import ModuleType

_UNITS = re.compile(r"\[[^\]]+\](, \[[^\]]+\])*")


def comments(cls: type) -> dict[str, str]:
    """The comment behind each field of a class, those of its bases included, without the #."""
    found: dict[str, str] = {}
    for base in reversed(cls.__mro__):
        if base.__module__ not in ("builtins", "pydantic.main"):
            found |= _in_module(sys.modules[base.__module__]).get(base.__name__, {})
    return found


@cache
def _in_module(module: ModuleType) -> dict[str, dict[str, str]]:
    """The comments of every class of a module by its name, by field."""
    source = inspect.getsource(module)
    tokens = tokenize.generate_tokens(io.StringIO(source).readline)
    lines = {t.start[0]: t.string.lstrip("# ") for t in tokens if t.type == tokenize.COMMENT}
    found: dict[str, dict[str, str]] = {}
    for node in ast.parse(source).body:
        if isinstance(node, ast.ClassDef):
            fields = [f for f in node.body if isinstance(f, ast.AnnAssign) and isinstance(f.target, ast.Name)]
            found[node.name] = {f.target.id: lines[f.end_lineno] for f in fields if f.end_lineno in lines}  # type: ignore
    return found


def split(comment: str) -> tuple[str, str]:
    """The unit and the meaning that a comment states; the unit comes first in it."""
    first = _UNITS.match(comment)
    if not first:
        return "", comment
    return ", ".join(re.findall(r"\[([^\]]+)\]", first[0])), comment[first.end() :].strip(" ,:;")
