"""Units and descriptions of a table's keys from the comments of its class.

The comment behind a field (`# [m] height of one foot`) is their only source.
"""

import ast
import inspect
import io
import re
import sys
import tokenize
from functools import cache
from types import ModuleType

from lapwing.syntax_tree import parse

_UNITS = re.compile(r"\[[^\]]+\](, \[[^\]]+\])*")


def comments(cls: type) -> dict[str, str]:
    """Return the comment behind each field of a class and its bases, without the #."""
    result: dict[str, str] = {}
    for base in reversed(cls.__mro__):
        if base.__module__ not in ("builtins", "pydantic.main"):
            result |= _in_module(sys.modules[base.__module__]).get(base.__name__, {})
    return result


@cache
def _in_module(module: ModuleType) -> dict[str, dict[str, str]]:
    """Return the comments of all classes of a module by class name and field."""
    source = inspect.getsource(module)
    tokens = tokenize.generate_tokens(io.StringIO(source).readline)
    lines = {t.start[0]: t.string.lstrip("# ") for t in tokens if t.type == tokenize.COMMENT}
    result: dict[str, dict[str, str]] = {}
    for node in parse(source).body:
        if isinstance(node, ast.ClassDef):
            fields = [f for f in node.body if isinstance(f, ast.AnnAssign) and isinstance(f.target, ast.Name)]
            result[node.name] = {f.target.id: lines[f.end_lineno] for f in fields if f.end_lineno in lines}  # type: ignore
    return result


def split(comment: str) -> tuple[str, str]:
    """Return unit and description of a comment, which starts with the unit."""
    first = _UNITS.match(comment)
    if not first:
        return "", comment
    return ", ".join(re.findall(r"\[([^\]]+)\]", first[0])), comment[first.end() :].strip(" ,:;")
