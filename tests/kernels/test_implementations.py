"""Assumption of the kernel cache: implementations are in the module of their function, which callers import."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
FILES = [p for folder in ("services", "lapwing") for p in (ROOT / folder).rglob("*.py")]
FOUND = [path for path in FILES if "@overload_for(" in path.read_text(encoding="utf-8")]


@pytest.mark.parametrize("path", FOUND, ids=lambda path: str(path.relative_to(ROOT)))
def test_implementation_is_in_module_of_its_function(path):
    tree = ast.parse(path.read_text(encoding="utf-8"))
    functions = [node for node in tree.body if isinstance(node, ast.FunctionDef)]
    calls = [
        d
        for f in functions
        for d in f.decorator_list
        if isinstance(d, ast.Call) and ast.unparse(d.func) == "overload_for"
    ]
    assert {ast.unparse(call.args[0]) for call in calls} <= {f.name for f in functions}
