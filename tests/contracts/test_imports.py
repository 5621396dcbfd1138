"""Absence of import cycles, including imports in functions and for type checkers only."""

import ast
from pathlib import Path


def imports():
    """Return the modules of this project that each module imports anywhere in its source."""
    paths = [
        *Path("lapwing").rglob("*.py"),
        *Path("lapwing/services").rglob("*.py"),
        *Path("lapwing/messages").rglob("*.py"),
    ]
    files = {path: path.with_suffix("").as_posix().replace("/", ".") for path in paths}
    names = {name.removesuffix(".__init__"): path for path, name in files.items()}
    result = {}
    for name, path in names.items():
        imported = set()
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                imported |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module:
                inner = {f"{node.module}.{alias.name}" for alias in node.names}
                imported |= inner & names.keys() or {node.module}
                imported |= {node.module} if inner - names.keys() else set()
        result[name] = (imported & names.keys()) - {name}
    return result


def cycle(diagram):
    """Return the names along an import cycle, or None."""
    done = set()

    def search(name, way):
        if name in way:
            return [*way[way.index(name) :], name]
        if name in done:
            return None
        for other in sorted(diagram[name]):
            if result := search(other, [*way, name]):
                return result
        done.add(name)
        return None

    return next((result for name in sorted(diagram) if (result := search(name, []))), None)


def test_cycle_is_found():
    assert cycle({"a": {"b"}, "b": {"c"}, "c": {"b"}}) == ["b", "c", "b"]


def test_project_has_no_import_cycle():
    diagram = imports()
    assert len(diagram) > 400
    assert cycle(diagram) is None
